"""Activation of a WSG: faults that it acknowledges, homing, its end, and how it is cancelled."""

from __future__ import annotations

import pytest
from permits import activate, forget, halt, move, set_force
from wsg_bench import Bench

from slipd.devices.shared.command_queue import ATTEMPTS
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_commands import ANSWER_NS
from slipd.devices.wsg.wsg_session import HOMING_NS


@pytest.mark.parametrize("how", ["halt", "drop"])
def test_an_unsent_activation_is_cancelled(bench: Bench, how: str) -> None:
    set_force(bench.session, 10.0)
    bench.run(0.1)
    activate(bench.session, bench.now_ns)
    assert (bench.session.force_sent_n, forget(bench.session, how)) == (None, True)
    bench.run(0.1)
    assert wire.HOME not in bench.commands()
    assert (bench.session.state, bench.session.force_sent_n) == ("active", 10.0)
    activate(bench.session, bench.now_ns)
    bench.run(1.0)
    assert (bench.session.state, bench.session.force_sent_n) == ("active", None)


def test_activation_homes_and_is_over_when_the_gripper_reports_it() -> None:
    bench = Bench()
    bench.gripper.words.clear()
    bench.start()
    assert (bench.session.state, bench.last.active, halt(bench.session)) == ("inactive", False, False)
    assert (move(bench.session, 0.0, None, 5.0), set_force(bench.session, 5.0)) == (None, None)
    activate(bench.session, bench.now_ns)
    bench.run(0.1)
    assert (bench.session.state, bench.last.active, move(bench.session, 0.0, None, 5.0)) == ("activating", False, None)
    bench.run(1.0)
    assert (bench.session.state, bench.last.active, bench.last.width_m) == ("active", True, pytest.approx(0.110))
    assert bench.commands() == [wire.HOME]


def test_homing_can_be_stopped() -> None:
    bench = Bench().start()
    activate(bench.session, bench.now_ns)
    bench.run(0.1)
    assert halt(bench.session)
    bench.run(1.0)
    assert (bench.last.width_m < 0.08, bench.commands()) == (True, [wire.HOME, wire.STOP])
    assert bench.session.state == "active"


def test_homing_without_an_end_is_lost(bench: Bench) -> None:
    activate(bench.session, bench.now_ns)
    bench.write(bench.session.on_time(bench.now_ns))
    bench.gripper._goal = None
    bench.run(HOMING_NS * 1e-9 + 0.001)
    assert bench.session.state == "command lost: no end of homing"


def test_activation_acknowledges_a_fault_first(bench: Bench) -> None:
    bench.gripper.words.add("fast_stop")
    bench.run(0.1)
    activate(bench.session, bench.now_ns)
    bench.run(1.0)
    assert bench.commands() == [wire.ACKNOWLEDGE, wire.HOME]
    assert bench.session.state == "active"


def test_an_activation_after_an_unanswered_force_outlasts_the_next_readings(bench: Bench) -> None:
    bench.swallow = lambda packet: packet.id == wire.SET_FORCE
    set_force(bench.session, 10.0)
    bench.run(0.001)
    activate(bench.session, bench.now_ns)
    bench.run(0.1)
    assert (bench.session.state, bench.session.command_lost, bench.last.active) == ("activating", False, False)
    bench.run(1.5)
    assert bench.commands() == [wire.SET_FORCE, wire.HOME], "the force no longer applies: it is not repeated"
    assert bench.session.state == "active"


@pytest.mark.parametrize("status", [None, 7])
def test_an_activation_that_was_lost_before_it_was_sent_blocks_nothing(bench: Bench, status: int | None) -> None:
    bench.gripper.words.add("fast_stop")
    bench.run(0.1)
    bench.swallow = lambda packet: status is None and packet.id == wire.ACKNOWLEDGE
    bench.forge = lambda asked: status if asked == wire.ACKNOWLEDGE else None
    activate(bench.session, bench.now_ns)
    bench.run(ANSWER_NS * 1e-9 * ATTEMPTS + 0.1)
    assert bench.session.state.startswith("command lost: ")
    assert (bench.session.activating, wire.HOME in bench.commands()) == (False, False)
    bench.swallow, bench.forge = lambda _: False, lambda _: None
    bench.session.acknowledge()
    bench.run(0.1)
    assert move(bench.session, 0.02, None, 5.0) == 5.0


def test_a_second_activation_that_is_dropped_leaves_the_first_in_progress(bench: Bench) -> None:
    activate(bench.session, bench.now_ns)
    bench.run(0.1)
    activate(bench.session, bench.now_ns)
    assert bench.session.drop()
    bench.run(0.1)
    assert (bench.session.activating, bench.last.active, bench.last.moving) == (True, False, True)
    assert set_force(bench.session, 5.0) is None
    bench.run(1.0)
    assert (bench.session.state, bench.commands()) == ("active", [wire.HOME])


def test_a_first_activation_that_ends_while_a_second_waits_does_not_end_the_second(bench: Bench) -> None:
    activate(bench.session, bench.now_ns)
    bench.run(0.1)
    activate(bench.session, bench.now_ns)
    bench.deliver([wire.encode_reply(wire.HOME)])
    assert bench.session.activating
    assert bench.session.drop()
    assert (bench.session.activating, set_force(bench.session, 5.0)) == (False, None), "a reading shows the state again"
    bench.run(0.03)
    assert set_force(bench.session, 5.0) == 5.0


def test_homing_that_was_stopped_can_be_stopped_again_before_the_next_reading(bench: Bench) -> None:
    activate(bench.session, bench.now_ns)
    bench.run(0.1)
    assert [halt(bench.session) for _ in range(3)] == [True] * 3
    assert (move(bench.session, 0.02, None, 5.0), bench.session.state) == (None, "inactive")
    bench.run(0.03)
    assert move(bench.session, 0.02, None, 5.0) == 5.0
