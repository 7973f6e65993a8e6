"""The session with an external driver: its set-points, and which answers it accepts."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import msgpack
import pytest
from millisecond_bench import GripperBench
from permits import halt, move, set_force

from slipd.devices.external_gripper import SILENCE_NS, Session
from slipd.devices.external_gripper.external_gripper_message import (
    Registration,
    Report,
)
from slipd.tools.sim.emulated_external import DRIVER, Driver, encode_driver_message


@dataclass
class Bench(GripperBench):
    """A session and a driver; keeps the messages to the driver."""

    session: Session = field(default_factory=Session)
    gripper: Driver = field(default_factory=Driver)

    def write(self, data: bytes) -> None:
        unpacker = msgpack.Unpacker()
        unpacker.feed(data)
        self.sent += unpacker
        self.deliver(self.gripper.receive(data, self.now_ns))

    def operations(self) -> list[str]:
        return [body["op"] for body in self.sent if "op" in body]


@pytest.fixture
def bench() -> Bench:
    """An active driver."""
    made = Bench().start()
    assert (made.session.state, made.gripper.notices) == ("active", [{"v": 1, "registered": "emulated driver"}])
    made.sent.clear()
    return made


@pytest.fixture
def holding(bench: Bench) -> Bench:
    """A gripper that holds an object."""
    assert bench.move(0.0, 0.2, 10.0, 0.4) == 10.0
    assert (bench.last.object, bench.last.width_m) == ("contact_closing", 0.04)
    bench.sent.clear()
    return bench


def ranges(session: Session) -> tuple[Any, ...]:
    return session.width_range_m, session.force_range_n, session.speed_range_mps


def test_a_driver_registers_and_reports_and_nothing_is_asked_of_it() -> None:
    bench = Bench()
    assert (bench.session.state, bench.session.next_deadline()) == ("closed", None)
    assert ranges(bench.session) == ((0.0, math.inf), (0.0, math.inf), None)
    bench.start().run(1.0)
    assert (bench.operations(), bench.session.identity) == ([], "emulated driver")
    assert ranges(bench.session) == (DRIVER.width_range_m, DRIVER.force_range_n, DRIVER.speed_range_mps)
    assert (bench.last.width_m, bench.last.active, bench.last.echo_ok) == (0.08, True, None)
    assert len(bench.samples) == pytest.approx(65, abs=1)
    assert bench.session.stop() == b""
    assert (bench.session.state, bench.session.next_deadline(), bench.session.identity) == ("closed", None, "")


def test_a_grip_is_answered_and_the_force_is_changed_while_it_holds(holding: Bench) -> None:
    assert (holding.last.force_n, holding.last.echo_ok) == (10.0, True)
    assert holding.set_force(12.0) == 12.0
    assert holding.sent == [{"v": 1, "id": 2, "op": "force", "force_n": 12.0}]
    assert (holding.last.force_n, holding.last.width_m, holding.session.command_lost) == (12.0, 0.04, False)


def test_D5_a_force_above_the_requested_one_shows_while_it_lasts(bench: Bench) -> None:
    bench.gripper.excess = 0.01
    bench.move(0.02, None, 10.0, 0.5)
    assert {sample.echo_ok for sample in bench.samples[-20:]} == {False}
    bench.gripper.excess = -0.01
    bench.set_force(10.0)
    assert bench.last.echo_ok is True


def test_D5_a_force_without_a_request_is_too_high() -> None:
    bench = Bench()
    bench.session.start(0)
    bench.deliver(
        [encode_driver_message(Registration("x", (0.0, 0.1), (0.0, 50.0))), encode_driver_message(Report(0.05))]
    )
    assert set_force(bench.session, 0.0) == 0.0
    bench.session.on_time(0)
    bench.deliver([encode_driver_message(Report(0.05, id=1, applied_n=50.0))])
    assert bench.last.echo_ok is False


@pytest.fixture
def unanswered(bench: Bench) -> Bench:
    """Return a session whose driver does not answer to a force."""
    bench.gripper.mute = True
    bench.set_force(10.0, 0.01)
    return bench


@pytest.mark.parametrize(
    ("report", "reason"),
    [
        (Report(0.05, id=1, error="finger guard is open"), "force: finger guard is open"),
        (Report(0.05, active=False), "not active"),
        (Report(0.05, fault="no_power"), "no_power"),
        (Report(0.05, active=False, fault="no_power"), "no_power"),
    ],
)
def test_A6_a_driver_that_refuses_or_cannot_is_not_asked_again(unanswered: Bench, report: Report, reason: str) -> None:
    unanswered.deliver([encode_driver_message(report)])
    assert unanswered.run(0.3).operations() == ["force"]
    assert unanswered.session.state == f"command lost: {reason}"


@pytest.mark.parametrize("name", ["bench", "unanswered"])
def test_an_answer_to_no_set_point_is_a_report_and_a_duplicate(name: str, request: pytest.FixtureRequest) -> None:
    bench = request.getfixturevalue(name)
    bench.deliver([encode_driver_message(Report(0.07, id=99, applied_n=50.0))])
    assert (bench.last.width_m, bench.last.echo_ok, bench.session.health.duplicates) == (0.07, None, 1)


@pytest.mark.parametrize("lie", [Report(0.2), Report(0.05, id=1)])
def test_an_implausible_report_is_counted_and_not_accepted(unanswered: Bench, lie: Report) -> None:
    seen = len(unanswered.samples)
    unanswered.deliver([encode_driver_message(lie)])
    assert (len(unanswered.samples), unanswered.session.health.bad) == (seen, 1)
    assert unanswered.session._queue.outstanding is not None


def test_a_driver_that_does_not_register_is_asked_to(bench: Bench) -> None:
    session = Session()
    session.start(0)
    assert session.state == "waiting"
    assert session.receive(encode_driver_message(Report(0.05)), 0) == []
    assert session.next_deadline() == 0
    assert msgpack.unpackb(session.on_time(0)) == {"v": 1, "refused": "the driver must register first"}
    assert (session.state, session.health.bad) == ("refused: the driver must register first", 1)
    assert move(session, 0.05, None, 5.0) is None
    assert session.on_time(SILENCE_NS - 1) == b""
    assert session.on_time(SILENCE_NS) != b""


def test_D2_another_version_of_the_format_is_refused_by_name() -> None:
    session = Session()
    session.start(0)
    session.receive(msgpack.packb({"v": 2, "name": "x"}), 0)
    assert session.state == "refused: the format must be version 1, got 2"
    assert msgpack.unpackb(session.on_time(0))["refused"] == "the format must be version 1, got 2"
    session.receive(encode_driver_message(DRIVER), 0)
    assert session.state == "waiting"


def test_a_driver_that_registers_again_starts_again(holding: Bench) -> None:
    assert holding.session.force_sent_n == 10.0
    holding.deliver([encode_driver_message(Registration(DRIVER.name, (0.0, 0.1), (1.0, 2.0)))])
    assert (holding.session.state, holding.session.health.restarts) == ("waiting", 1)
    assert (holding.session.force_range_n, holding.session.force_sent_n) == ((1.0, 2.0), None)
    assert (holding.run(0.1).operations(), holding.session.command_lost, holding.session.state) == ([], False, "active")


@pytest.mark.parametrize("sent", [False, True])
def test_A6_a_set_point_that_a_registration_overtakes_is_lost_and_not_sent_again(bench: Bench, sent: bool) -> None:
    bench.gripper.mute = True
    bench.set_force(10.0, 0.01 * sent)
    bench.deliver([encode_driver_message(DRIVER)])
    assert bench.session.command_lost
    assert (bench.run(1.0).operations(), bench.session.state) == (
        ["force"] * sent,
        "command lost: the driver registered again",
    )
    bench.gripper.mute = False
    bench.set_force(11.0)
    assert bench.session.state == "active"


def test_another_driver_on_the_same_connection_receives_nothing_until_the_first_registers_again(bench: Bench) -> None:
    session, reason = bench.session, "another driver registered on this connection: reconnect"
    set_force(session, 10.0)
    bench.samples.clear()
    bench.deliver([encode_driver_message(Registration("stranger", (0.0, 0.1), (1.0, 200.0)))])
    for _ in range(2):
        assert msgpack.unpackb(session.on_time(bench.now_ns)) == {"v": 1, "refused": reason}
        bench.deliver([encode_driver_message(Report(0.05))])
    assert (session.identity, session.state) == (DRIVER.name, f"refused: {reason}")
    assert (move(session, 0.0, None, 5.0), set_force(session, 5.0), halt(session)) == (None, None, False)
    assert (bench.samples, session.command_lost) == ([], True)
    bench.deliver([encode_driver_message(DRIVER), encode_driver_message(Report(0.05))])
    assert set_force(session, 5.0) == 5.0
