"""The Robotiq session against the registers of a gripper, on a line that loses, delays, damages and refuses."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import pytest
from gripper_registers import GripperLine
from nanoseconds import MS
from permits import activate, halt, move, set_force

from slipd.devices.robotiq_2f import Session
from slipd.devices.shared import modbus
from slipd.tools.sim.emulated_robotiq_2f import encode_exception
from slipd.types.samples import GripperSample

ILLEGAL_FUNCTION = 1  # of Modbus exceptions
POLL = bytes.fromhex("09 04 07 D0 00 03 B1 CE")
OLD_POLL = bytes.fromhex("09 03 07 D0 00 03 04 0E")
CLEAR = bytes.fromhex("09 10 03 E8 00 03 06 00 00 00 00 00 00 73 30")
ACTIVATE = bytes.fromhex("09 10 03 E8 00 03 06 01 00 00 00 00 00 72 E1")
OPEN = bytes.fromhex("09 10 03 E8 00 03 06 09 00 00 00 FF FF 72 19")
GO = bytes.fromhex("09 10 03 E8 00 03 06 09 00 00 C8 80 3C 93 86")
FORCE = bytes.fromhex("09 10 03 EA 00 01 02 80 5A 05 A1")


class Gripper(GripperLine):
    """A gripper that may refuse a function."""

    refuses: int | None = None

    def _answer(self, request: modbus.Request) -> bytes:
        if request.function == self.refuses:
            return encode_exception(request, ILLEGAL_FUNCTION)
        return super()._answer(request)


class Bench:
    """A session with force byte = N - 1, position byte = mm closed and speed byte = mm/s; a reply takes 6 ms."""

    def __init__(self) -> None:
        self.session = Session(
            force_table=[(0, 1.0), (255, 256.0)],
            width_table=[(0.0, 0.255), (1.0, 0.0)],
            speed_table=[(0, 0.0), (255, 0.255)],
        )
        self.gripper = Gripper()
        self.now_ns = 0
        self.sent: list[tuple[int, bytes]] = []
        self.samples: list[GripperSample] = []

    def start(self) -> None:
        self.transact(self.session.start(self.now_ns))

    def transact(self, data: bytes) -> None:
        if data:
            self.sent.append((self.now_ns, data))
        if reply := self.gripper.answer(data):
            self.now_ns += 6 * MS
            self.samples += self.session.receive(reply, self.now_ns)

    def steps(self, count: int) -> None:
        for _ in range(count):
            due_ns = self.session.next_deadline()
            assert due_ns is not None
            self.now_ns = max(self.now_ns, due_ns)
            self.transact(self.session.on_time(self.now_ns))

    def polled(self) -> bytes:
        """Poll; return the reply, which is still on its way."""
        self.now_ns += 20 * MS
        return self.gripper.answer(self.session.on_time(self.now_ns))

    def move(self, position: int, speed: int, force: int) -> float | None:
        return move(self.session, (255 - position) / 1000, speed / 1000, force + 1.0)

    def set_force(self, force: int) -> float | None:
        return set_force(self.session, force + 1.0)

    def commands(self) -> list[bytes]:
        return [data for _, data in self.sent if data not in (POLL, OLD_POLL)]


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def active(bench: Bench) -> Bench:
    bench.gripper.outputs, bench.gripper.stage = (0x0100, 0, 0), 3
    bench.start()
    assert bench.session.state == "active"
    bench.sent.clear()
    return bench


def test_starting_only_polls_and_moves_nothing(bench: Bench) -> None:
    bench.start()
    bench.steps(200)
    assert (bench.commands(), bench.session.state) == ([], "inactive")
    assert {later[0] - earlier[0] for earlier, later in pairwise(bench.sent)} == {20 * MS}
    assert (bench.session.stop(), bench.session.next_deadline()) == (b"", None)


def test_move_and_force_are_the_published_bytes_and_go_before_the_next_poll(active: Bench) -> None:
    assert active.move(200, 128, 60)
    assert active.session.next_deadline() == active.now_ns + 5 * MS
    active.steps(1)
    assert active.set_force(90)
    active.steps(2)
    assert active.move(0, 255, 255)
    active.steps(1)
    assert [data for _, data in active.sent] == [GO, FORCE, POLL, OPEN]


def test_commands_keep_five_milliseconds_from_the_last_reply_and_one_transaction_at_a_time(active: Bench) -> None:
    reply = active.polled()
    active.move(200, 128, 60)
    assert active.session.on_time(active.now_ns + 50 * MS) == b""
    active.session.receive(reply, active.now_ns + 50 * MS)
    assert active.session.on_time(active.now_ns + 55 * MS - 1) == b""
    assert active.session.on_time(active.now_ns + 55 * MS) == GO


def test_the_ranges_are_those_of_the_tables(active: Bench) -> None:
    session = active.session
    active.gripper.position = 55
    active.steps(1)
    assert active.samples[-1].width_m == pytest.approx(0.2)
    ranges = session.width_range_m, session.speed_range_mps, session.force_range_n
    assert ranges == ((0.0, 0.255), (0.0, 0.255), (1.0, 256.0))
    without = Session(speed_table=None)
    assert without.speed_range_mps is None
    with pytest.raises(ValueError, match="the speed must be left out"):
        move(without, 0.0, 0.1, 30.0)


@pytest.mark.parametrize("silent_first", [False, True])
def test_a_gripper_with_the_older_status_function_is_found(bench: Bench, silent_first: bool) -> None:
    bench.gripper.silent = silent_first
    bench.gripper.refuses = None if silent_first else modbus.READ_INPUT
    bench.start()
    bench.steps(3)
    assert bench.sent[-1][1] == OLD_POLL
    bench.gripper.silent = False
    bench.steps(3)
    assert (bench.sent[-1][1], bench.session.state) == (OLD_POLL, "inactive")


def test_D5_an_echo_that_differs_from_the_position_last_sent_shows_while_it_lasts(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(2)
    active.gripper.echo = 199
    active.steps(3)
    active.set_force(90)
    active.steps(2)
    active.gripper.echo = None
    active.steps(1)
    activate(active.session, active.now_ns)
    active.steps(3)
    assert [sample.echo_ok for sample in active.samples] == [None, True, *[False] * 4, True, None]


@pytest.mark.parametrize("stage", [0, 1, 3])
@pytest.mark.parametrize("fault", [*range(5, 16), 0x30])
def test_D4_a_fault_is_shown_and_nothing_is_tried_against_it(active: Bench, fault: int, stage: int) -> None:
    active.move(200, 128, 60)
    active.steps(2)
    active.gripper.fault, active.gripper.stage = fault, stage
    active.steps(10)
    assert active.commands() == [GO]
    assert {(sample.fault == "", sample.active) for sample in active.samples[-10:]} == {(False, stage == 3)}
    assert (active.set_force(90) is None) == (stage != 3)
    active.session.acknowledge()
    active.steps(3)
    assert active.commands()[1:] == ([FORCE] if stage == 3 else [])


def test_a_flood_of_commands_leaves_every_third_turn_to_the_poll(active: Bench) -> None:
    active.now_ns += 20 * MS
    for force in range(9):
        active.set_force(force)
        active.steps(1)
    assert [data == POLL for _, data in active.sent] == [False, False, True] * 3


def test_a_line_on_which_nothing_at_all_comes_back_is_explained(active: Bench) -> None:
    active.gripper.silent = True
    notes = []
    for noise in (b"", b"", b"", b"\0", b""):
        active.steps(1)
        notes.append(active.session.health.note.partition(":")[0])
        active.session.receive(noise, active.now_ns)
    assert notes == ["", "", "", "no reply at Modbus address 9", ""]


def test_noise_is_counted_between_the_replies_and_before_one(active: Bench) -> None:
    active.session.receive(b"\x09\x04", active.now_ns)
    reply = active.polled()
    active.session.receive(bytes(300), active.now_ns)
    assert len(active.session.receive(b"\x00" + reply, active.now_ns)) == 1
    assert (active.session.health.bad, active.session.health.bad_bytes) == (3, 303)


def test_activation_clears_then_activates_and_waits_until_the_gripper_reports_it(bench: Bench) -> None:
    bench.gripper.activates = True
    bench.start()
    reply = bench.polled()
    activate(bench.session, bench.now_ns)
    bench.session.receive(reply, bench.now_ns)
    assert bench.move(1, 2, 3) is None, "a reply that was on its way does not undo it"
    bench.steps(3)
    assert bench.commands() == [CLEAR, ACTIVATE]
    assert (bench.session.state, bench.samples[-1].active, bench.samples[-1].moving) == ("activating", False, True)
    bench.gripper.stage = 3
    bench.steps(1)
    assert (bench.session.state, bench.samples[-1].active) == ("active", True)


def test_a_command_is_dropped_when_the_gripper_turns_out_to_be_inactive(active: Bench) -> None:
    active.gripper.stage = 0
    reply = active.polled()
    active.move(200, 128, 60)
    active.session.receive(reply, active.now_ns)
    active.steps(5)
    assert (active.commands(), active.session.command_lost, active.session.state) == ([], True, "command lost")


@pytest.mark.parametrize("cancel", [halt, Session.drop])
def test_a_status_received_during_a_queued_activation_counts_after_its_cancellation(
    bench: Bench, cancel: Callable[[Session], bool]
) -> None:
    bench.start()
    activate(bench.session, bench.now_ns)
    bench.gripper.outputs, bench.gripper.stage = (0x0100, 0, 0), 3  # another master activated it
    bench.session.receive(bench.gripper.answer(bench.session._line.poll(bench.now_ns)), bench.now_ns)
    assert (bench.session.state, bench.session.activating) == ("activating", True)
    assert cancel(bench.session)
    assert (bench.session.state, bench.session.activating) == ("active", False)


def test_a_move_that_was_lost_before_it_was_sent_is_not_a_goal(active: Bench) -> None:
    active.gripper.silent = True
    active.steps(3)
    active.move(200, 128, 60)
    active.steps(1)
    assert (active.commands(), active.session.command_lost, active.session.force_sent_n) == ([], True, None)
    active.gripper.silent = False
    active.steps(4)
    active.set_force(90)
    halt(active.session)
    active.steps(2)
    assert active.gripper.command.force == 90
