"""The Robotiq session against a simple gripper on a line that loses, delays, damages and refuses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import pytest
from permits import activate, forget, halt, move, set_force

from slipd.devices import robotiq_2f
from slipd.devices.robotiq_2f import robotiq_registers
from slipd.devices.shared import modbus
from slipd.samples import GripperSample

ILLEGAL_FUNCTION = 1  # of Modbus exceptions

SplitCheck = Callable[[Callable[[], Any], bytes], list[tuple[Any, ...]]]

MS = 1_000_000

POLL = bytes.fromhex("09 04 07 D0 00 03 B1 CE")
OLD_POLL = bytes.fromhex("09 03 07 D0 00 03 04 0E")
CLEAR = bytes.fromhex("09 10 03 E8 00 03 06 00 00 00 00 00 00 73 30")
ACTIVATE = bytes.fromhex("09 10 03 E8 00 03 06 01 00 00 00 00 00 72 E1")
OPEN = bytes.fromhex("09 10 03 E8 00 03 06 09 00 00 00 FF FF 72 19")
GO = bytes.fromhex("09 10 03 E8 00 03 06 09 00 00 C8 80 3C 93 86")
FORCE = bytes.fromhex("09 10 03 EA 00 01 02 80 5A 05 A1")


@dataclass
class Gripper:
    """A gripper that activates within two polls and reaches its goal at once."""

    output: tuple[int, ...] = (0, 0, 0)
    stage: int = 0
    fault: int = 0
    position: int = 3
    echo: int | None = None
    mute: bool = False
    refuses: tuple[int, ...] = ()
    received: bytes = b""

    def respond(self, data: bytes) -> bytes:
        requests, self.received = modbus.parse_requests(self.received + data, 9)
        return b"" if self.mute else b"".join(self.answer(request) for request in requests)

    def answer(self, request: modbus.Request) -> bytes:
        if request.function in self.refuses:
            return modbus.encode_exception(request, ILLEGAL_FUNCTION)
        if request.function == modbus.WRITE:
            written = robotiq_registers.write_output(self.output, request)
            if written is None:
                return modbus.encode_exception(request, modbus.ILLEGAL_ADDRESS)
            self.obey(written)
            return modbus.encode_reply(request)
        output = robotiq_registers.parse_output(self.output)
        if self.echo is not None:
            output = robotiq_registers.parse_output((self.output[0], self.echo, self.output[2]))
        registers = robotiq_registers.status_registers(
            output, stage=self.stage, found=3, fault=self.fault, position=self.position, current_a=0.1
        )
        self.stage = 3 if self.stage == 1 else self.stage
        return modbus.encode_reply(request, registers)

    def obey(self, written: tuple[int, ...]) -> None:
        was, output = (robotiq_registers.parse_output(registers) for registers in (self.output, written))
        self.output = written
        if output.activate and not was.activate:
            self.stage = 1
        elif not output.activate:
            self.stage = 0
        elif output.go and self.stage == 3:
            self.position = output.position


def session() -> robotiq_2f.Session:
    """Return a session with force byte = N - 1, position byte = mm closed, and speed byte = mm/s."""
    return robotiq_2f.Session(
        force_table=[(0, 1.0), (255, 256.0)],
        width_table=[(0.0, 0.255), (1.0, 0.0)],
        speed_table=[(0, 0.0), (255, 0.255)],
    )


@dataclass
class Bench:
    """Run the session with a simulated clock; a reply takes 6 ms."""

    session: robotiq_2f.Session = field(default_factory=session)
    gripper: Gripper = field(default_factory=Gripper)
    now_ns: int = 0
    sent: list[tuple[int, bytes]] = field(default_factory=list)
    samples: list[GripperSample] = field(default_factory=list)

    def start(self) -> Bench:
        self.transact(self.session.start(self.now_ns))
        return self

    def transact(self, data: bytes) -> None:
        if not data:
            return
        self.sent.append((self.now_ns, data))
        reply = self.gripper.respond(data)
        if reply:
            self.now_ns += 6 * MS
            self.samples += self.session.receive(reply, self.now_ns)

    def steps(self, count: int) -> None:
        for _ in range(count):
            due = self.session.next_deadline()
            assert due is not None
            self.now_ns = max(self.now_ns, due)
            self.transact(self.session.on_time(self.now_ns))

    def move(self, position: int, speed: int, force: int) -> float | None:
        return move(self.session, (255 - position) / 1000, speed / 1000, force + 1.0)

    def set_force(self, force: int) -> float | None:
        return set_force(self.session, force + 1.0)

    def commands(self) -> list[bytes]:
        return [data for _, data in self.sent if data not in (POLL, OLD_POLL)]


@pytest.fixture
def active() -> Bench:
    bench = Bench(gripper=Gripper(output=(0x0100, 0, 0), stage=3)).start()
    assert bench.session.state == "active"
    bench.sent.clear()
    return bench


def test_starting_only_polls_and_moves_nothing() -> None:
    bench = Bench().start()
    bench.steps(200)
    assert bench.commands() == []
    assert bench.session.state == "inactive"
    gaps = {later[0] - earlier[0] for earlier, later in pairwise(bench.sent)}
    assert gaps == {20 * MS}
    assert bench.session.stop() == b""
    assert bench.session.next_deadline() is None


def test_activation_clears_then_activates_and_waits_until_the_gripper_reports_it() -> None:
    bench = Bench().start()
    activate(bench.session, bench.now_ns)
    assert bench.move(1, 2, 3) is None
    bench.steps(3)
    assert bench.commands() == [CLEAR, ACTIVATE]
    assert (bench.session.state, bench.samples[-1].active, bench.samples[-1].moving) == ("activating", False, True)
    bench.steps(1)
    assert (bench.session.state, bench.samples[-1].active) == ("active", True)


def test_activation_asked_for_while_a_poll_is_out_is_not_undone_by_its_reply(active: Bench) -> None:
    active.now_ns += 20 * MS
    reply = active.gripper.respond(active.session.on_time(active.now_ns))
    activate(active.session, active.now_ns)
    active.session.receive(reply, active.now_ns)
    assert active.move(1, 2, 3) is None
    active.steps(2)
    assert active.commands() == [CLEAR, ACTIVATE]


def test_move_and_force_are_the_published_bytes_and_go_before_the_next_poll(active: Bench) -> None:
    assert active.move(200, 128, 60)
    assert active.session.next_deadline() == active.now_ns + 5 * MS
    active.steps(1)
    assert active.set_force(90)
    active.steps(2)
    assert active.move(0, 255, 255)
    active.steps(1)
    assert [data for _, data in active.sent] == [GO, FORCE, POLL, OPEN]
    assert robotiq_registers.parse_output(active.gripper.output).position == 0


def test_commands_keep_five_milliseconds_from_the_last_reply_and_one_transaction_at_a_time(active: Bench) -> None:
    active.now_ns += 20 * MS
    assert active.session.on_time(active.now_ns) == POLL
    active.move(200, 128, 60)
    assert active.session.on_time(active.now_ns + 50 * MS) == b""
    active.session.receive(active.gripper.respond(POLL), active.now_ns + 50 * MS)
    assert active.session.on_time(active.now_ns + 55 * MS - 1) == b""
    assert active.session.on_time(active.now_ns + 55 * MS) == GO


def test_a_newer_command_replaces_one_that_was_not_sent_yet(active: Bench) -> None:
    active.move(10, 1, 1)
    active.move(200, 128, 9)
    active.set_force(60)
    active.steps(1)
    assert active.sent[-1][1] == GO
    active.set_force(1)
    active.set_force(90)
    active.steps(2)
    assert active.commands() == [GO, FORCE]


def test_force_without_a_move_keeps_the_position_register_alone(active: Bench) -> None:
    active.set_force(90)
    active.steps(1)
    assert active.gripper.output == (0x0100, 0, 90)


def test_halt_clears_go_and_keeps_the_gripper_active(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    halt(active.session)
    active.set_force(90)
    active.steps(3)
    assert active.gripper.output == (0x0100, 200, 0x805A)
    active.steps(1)
    assert active.samples[-1].active


def test_a_halt_keeps_a_force_that_waits(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    active.set_force(90)
    halt(active.session)
    active.steps(3)
    assert active.gripper.output == (0x0100, 200, 0x805A)


def test_a_halt_drops_a_move_that_never_began_with_its_force(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    active.move(0, 255, 0)
    halt(active.session)
    active.steps(2)
    assert active.gripper.output == (0x0100, 200, 0x803C)


@pytest.mark.parametrize("how", ["halt", "drop"])
def test_the_force_sent_is_the_one_in_effect_once_waiting_commands_are_dropped(active: Bench, how: str) -> None:
    assert active.session.force_sent_n is None, "the gripper was active before"
    active.move(200, 128, 60)
    assert active.session.force_sent_n == 61.0
    active.steps(1)
    active.set_force(90)
    active.steps(1)
    active.move(0, 255, 0)
    assert (active.session.force_sent_n, forget(active.session, how)) == (1.0, True)
    assert active.session.force_sent_n == 91.0
    active.steps(3)
    assert active.gripper.output == (0x0100 if how == "halt" else 0x0900, 200, 0x805A)


def test_the_force_sent_is_that_of_a_force_that_is_repeated_after_a_halt(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    active.gripper.mute = True
    active.set_force(90)
    active.steps(1)
    active.move(0, 255, 0)
    halt(active.session)
    active.gripper.mute = False
    for _ in range(4):
        assert active.session.force_sent_n == 91.0
        active.steps(1)
    assert active.gripper.output == (0x0100, 200, 0x805A)


def test_dropped_commands_are_not_sent_and_sent_ones_are_not_repeated(active: Bench) -> None:
    active.gripper.mute = True
    active.move(200, 128, 60)
    active.steps(1)
    active.move(0, 255, 255)
    assert active.session.drop()
    assert active.session.drop() is False
    active.gripper.mute = False
    active.steps(5)
    assert (active.commands(), active.session.state) == ([GO], "command lost")
    assert (active.gripper.position, active.session.force_sent_n) == (3, 61.0)
    active.move(200, 128, 60)
    active.gripper.mute = True
    active.steps(1)
    active.gripper.mute = False
    active.steps(1)
    assert (active.commands(), active.session.command_lost) == ([GO] * 3, False), "a later one is repeated"


def test_a_move_dropped_while_a_poll_was_out_is_not_made_by_a_later_force(active: Bench) -> None:
    active.gripper.mute = True
    active.steps(1)
    active.move(200, 128, 60)
    assert active.session.drop()
    active.gripper.mute = False
    active.set_force(90)
    halt(active.session)
    active.steps(3)
    assert active.gripper.output[1] == 0
    assert active.gripper.output[2] & 0xFF == 90
    assert (active.session.force_sent_n, active.session.command_lost) == (91.0, False)


def test_a_move_that_is_not_repeated_is_not_made_by_a_later_force(active: Bench) -> None:
    active.gripper.mute = True
    active.move(200, 128, 60)
    active.steps(1)
    active.session.drop()
    active.set_force(90)
    active.gripper.mute = False
    active.steps(3)
    assert active.gripper.output == (0x0100, 0, 0x805A)


def test_a_halt_is_not_dropped_and_is_repeated(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    halt(active.session)
    assert active.session.drop() is False
    active.gripper.mute = True
    active.steps(1)
    active.session.drop()
    active.gripper.mute = False
    active.steps(1)
    assert (active.gripper.output[0], active.session.command_lost) == (0x0100, False)


@pytest.mark.parametrize("how", ["halt", "drop"])
def test_an_unsent_activation_is_cancelled(active: Bench, how: str) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    activate(active.session, active.now_ns)
    assert (active.session.force_sent_n, active.set_force(90)) == (None, None)
    assert forget(active.session, how)
    active.steps(4)
    assert CLEAR not in active.commands()
    assert active.gripper.output[0] == (0x0100 if how == "halt" else 0x0900), "its previous motion is stopped"
    assert (active.session.state, active.session.force_sent_n) == ("active", 61.0)


def test_half_an_activation_is_cancelled_by_a_halt_though_the_first_half_is_unanswered() -> None:
    bench = Bench().start()
    activate(bench.session, bench.now_ns)
    bench.gripper.mute = True
    bench.steps(1)
    assert halt(bench.session)
    assert halt(bench.session) is False
    bench.gripper.mute = False
    bench.steps(5)
    assert (bench.commands(), bench.gripper.stage) == ([CLEAR], 0)


def test_a_gripper_whose_activation_was_cancelled_halfway_accepts_nothing(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    activate(active.session, active.now_ns)
    active.steps(1)
    assert halt(active.session)
    assert (active.session.force_sent_n, active.move(1, 2, 3), halt(active.session)) == (None, None, False)
    active.steps(3)
    assert (active.commands(), active.session.state) == ([GO, CLEAR], "inactive")


@pytest.mark.parametrize("how", ["activated", "power lost"])
def test_a_gripper_that_was_inactive_meanwhile_has_no_force(active: Bench, how: str) -> None:
    active.move(200, 128, 60)
    active.steps(2)
    if how == "activated":
        activate(active.session, active.now_ns)
    else:
        active.gripper.stage = 0
    active.steps(1)
    assert active.session.force_sent_n is None
    active.gripper.stage = 3
    active.steps(5)
    assert (active.session.state, active.session.force_sent_n) == ("active", None)


def test_a_move_that_was_lost_before_it_was_sent_is_not_a_goal(active: Bench) -> None:
    active.gripper.mute = True
    active.steps(3)
    active.move(200, 128, 60)
    active.steps(1)
    assert (active.commands(), active.session.command_lost, active.session.force_sent_n) == ([], True, None)
    active.gripper.mute = False
    active.steps(4)
    active.set_force(90)
    halt(active.session)
    active.steps(2)
    assert active.gripper.output[2] & 0xFF == 90


def test_stopping_with_an_unanswered_command_sends_nothing(active: Bench) -> None:
    active.move(200, 128, 60)
    assert (active.session.stop(), active.session.next_deadline()) == (b"", None)


@pytest.mark.parametrize("value", [-0.001, 0.256, float("nan"), float("inf")])
def test_a_width_or_speed_that_the_gripper_does_not_have_is_refused(active: Bench, value: float) -> None:
    with pytest.raises(ValueError, match=r"the width must be from 0 to 0\.255 m, got"):
        move(active.session, value, 0.1, 5.0)
    with pytest.raises(ValueError, match=r"the speed must be from 0 to 0\.255 m/s, got"):
        move(active.session, 0.1, value, 5.0)
    active.steps(5)
    assert active.commands() == []


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_N2_a_force_that_is_not_finite_is_refused(active: Bench, value: float) -> None:
    for ask in (lambda: move(active.session, 0.1, None, value), lambda: set_force(active.session, value)):
        with pytest.raises(ValueError, match="must be finite"):
            ask()
    active.steps(5)
    assert active.commands() == []


def test_the_force_sent_is_that_of_the_byte_below_the_request(active: Bench) -> None:
    assert move(active.session, 0.1, None, 5.9) == active.session.applied_n(5.9) == 5.0
    assert set_force(active.session, 7.999) == 7.0
    assert set_force(active.session, 0.2) == 1.0, "the gripper's smallest force"
    assert set_force(active.session, 1e9) == 256.0
    active.steps(1)
    output = robotiq_registers.parse_output(active.gripper.output)
    assert (output.position, output.speed, output.force) == (155, 128, 255)


def test_the_ranges_are_those_of_the_tables(active: Bench) -> None:
    session = active.session
    assert (session.width_range_m, session.speed_range_mps, session.force_range_n) == (
        (0.0, 0.255),
        (0.0, 0.255),
        (1.0, 256.0),
    )
    without = robotiq_2f.Session(speed_table=None)
    assert without.speed_range_mps is None
    with pytest.raises(ValueError, match="the speed must be left out"):
        move(without, 0.0, 0.1, 30.0)


def test_the_width_is_read_by_the_table(active: Bench) -> None:
    active.gripper.position = 55
    active.steps(1)
    assert active.samples[-1].width_m == pytest.approx(0.2)


def test_nothing_is_commanded_to_a_gripper_that_is_not_active() -> None:
    bench = Bench().start()
    assert (bench.move(1, 2, 3), bench.set_force(1), halt(bench.session)) == (None, None, False)
    bench.steps(5)
    assert bench.commands() == []


def test_a_command_is_dropped_when_the_gripper_turns_out_to_be_inactive(active: Bench) -> None:
    active.now_ns += 20 * MS
    poll = active.session.on_time(active.now_ns)
    active.move(200, 128, 60)
    active.gripper.stage = 0
    active.session.receive(active.gripper.respond(poll), active.now_ns)
    active.steps(5)
    assert active.commands() == []
    assert active.session.command_lost
    assert active.session.state == "command lost"


def test_A6_an_unanswered_command_is_repeated_twice_and_then_lost(active: Bench) -> None:
    active.gripper.mute = True
    active.move(200, 128, 60)
    active.steps(3)
    assert active.session.state == "active"
    active.steps(4)
    assert active.commands() == [GO] * 3
    assert active.session.state == "no reply"
    assert active.session.command_lost
    assert active.session.health.lost == 6
    times = [time for time, _ in active.sent]
    assert all(later - earlier == 100 * MS for earlier, later in pairwise(times))


def test_D4_after_a_loss_of_power_nothing_is_sent_before_a_new_status(active: Bench) -> None:
    active.gripper.mute = True
    active.steps(5)
    assert active.session.state == "no reply"
    assert active.move(1, 2, 3) is None
    active.gripper.mute = False
    active.steps(2)
    assert active.session.state == "active"
    assert active.move(200, 128, 60)
    active.steps(1)
    assert active.commands() == [GO]
    assert not active.session.command_lost


def test_a_newer_move_replaces_an_unanswered_one(active: Bench) -> None:
    active.gripper.mute = True
    active.move(1, 1, 1)
    active.steps(1)
    active.move(200, 128, 60)
    active.gripper.mute = False
    active.steps(3)
    assert [data == GO for data in active.commands()] == [False, True]
    assert active.samples[-1].echo_ok


def test_an_unanswered_force_is_not_repeated_after_a_newer_one(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    active.gripper.mute = True
    active.set_force(1)
    active.steps(1)
    halt(active.session)
    active.set_force(90)
    active.gripper.mute = False
    active.steps(4)
    assert active.gripper.output == (0x0100, 200, 0x805A)


def test_an_unanswered_force_is_not_repeated_after_a_newer_move(active: Bench) -> None:
    active.gripper.mute = True
    active.set_force(1)
    active.steps(1)
    active.move(200, 128, 60)
    active.gripper.mute = False
    active.steps(4)
    assert active.gripper.output == (0x0900, 200, 0x803C)


def test_a_lost_clear_never_leads_to_a_bare_activation() -> None:
    bench = Bench().start()
    bench.gripper.mute = True
    activate(bench.session, bench.now_ns)
    bench.steps(5)
    assert bench.commands() == [CLEAR] * 3
    bench.gripper.mute = False
    bench.steps(5)
    assert bench.commands() == [CLEAR] * 3
    assert bench.session.command_lost


def test_A6_a_refused_command_is_not_repeated(active: Bench) -> None:
    active.gripper.refuses = (modbus.WRITE,)
    active.move(200, 128, 60)
    active.steps(4)
    assert active.commands() == [GO]
    assert active.session.state == "command lost"
    active.gripper.refuses = ()
    active.set_force(90)
    active.steps(1)
    assert active.session.state == "active"


@pytest.mark.parametrize("mute_first", [False, True])
def test_a_gripper_with_the_older_status_function_is_found(mute_first: bool) -> None:
    bench = Bench(gripper=Gripper(refuses=() if mute_first else (modbus.READ_INPUT,), mute=mute_first)).start()
    if mute_first:
        bench.steps(3)
        assert bench.sent[-1][1] == OLD_POLL
        bench.gripper.mute = False
    bench.steps(3)
    assert bench.sent[-1][1] == OLD_POLL
    assert bench.session.state == "inactive"


def test_the_echo_is_checked_against_the_position_last_sent(active: Bench) -> None:
    assert active.samples[-1].echo_ok is None
    active.move(200, 128, 60)
    active.steps(2)
    assert active.samples[-1].echo_ok is True
    active.gripper.echo = 199
    active.steps(1)
    assert active.samples[-1].echo_ok is False
    activate(active.session, active.now_ns)
    active.steps(3)
    assert active.samples[-1].echo_ok is None


def test_D5_an_echo_that_differs_shows_in_every_status_while_it_lasts(active: Bench) -> None:
    active.move(200, 128, 60)
    active.gripper.echo = 0
    active.steps(4)
    assert [sample.echo_ok for sample in active.samples[-3:]] == [False] * 3
    active.set_force(90)
    active.steps(2)
    assert active.samples[-1].echo_ok is False
    active.gripper.echo = None
    active.steps(1)
    assert active.samples[-1].echo_ok is True


@pytest.mark.parametrize("stage", [0, 1, 3])
@pytest.mark.parametrize("fault", [*range(5, 16), 0x30])
def test_D4_a_fault_is_shown_and_nothing_is_tried_against_it(active: Bench, fault: int, stage: int) -> None:
    active.move(200, 128, 60)
    active.steps(2)
    active.gripper.fault = fault
    for _ in range(10):
        active.gripper.stage = stage
        active.steps(1)
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


def test_replies_are_read_in_any_split_and_among_noise(active: Bench) -> None:
    for cut in range(12):
        active.now_ns += 20 * MS
        reply = active.gripper.respond(active.session.on_time(active.now_ns))
        pieces = [b"\x09\x04" + reply[:cut], reply[cut:]]
        samples = [sample for piece in pieces for sample in active.session.receive(piece, active.now_ns)]
        assert len(samples) == 1
    assert active.session.health.bad_bytes == 24


def test_endless_garbage_is_neither_kept_nor_mistaken_for_a_reply(active: Bench) -> None:
    active.now_ns += 20 * MS
    active.session.on_time(active.now_ns)
    for _ in range(100):
        assert active.session.receive(b"\x09\x04\x06" * 1000, active.now_ns) == []
        assert len(active.session._line.received) <= modbus.MAX_FRAME
    assert active.session.receive(active.gripper.respond(POLL), active.now_ns) != []


@pytest.mark.parametrize("period", [0.0, 0.004, -1, float("nan")])
def test_a_poll_period_below_the_grippers_pause_is_refused(period: float) -> None:
    with pytest.raises(ValueError, match=r"0\.005"):
        robotiq_2f.Session(poll_period_s=period)


def test_the_decoder_reads_status_replies_from_any_split(same_for_every_split: SplitCheck) -> None:
    output = robotiq_registers.Output(activate=True, go=True, release=False, position=255, speed=1, force=2)
    poll = modbus.Request(9, modbus.READ_HOLDING, 2000, 3)
    replies = [
        modbus.encode_reply(
            poll,
            robotiq_registers.status_registers(output, stage=3, found=2, fault=0, position=at, current_a=9.0),
        )
        for at in range(5)
    ]
    stream = b"\x09\x03\x06" + replies[0] + ACTIVATE[:8] + b"".join(replies[1:])
    assert len(same_for_every_split(robotiq_2f.Decoder, stream)) == 5
    decoder = robotiq_2f.Decoder()
    decoder.receive(replies[0][:6], 0)
    decoder.forget()
    assert decoder.receive(replies[0][6:], 0) == []


@pytest.mark.parametrize("unit", [0, 248, 9.0])
def test_an_address_that_no_gripper_has_is_refused(unit: int) -> None:
    with pytest.raises(ValueError, match="1 to 247"):
        robotiq_2f.Session(unit=unit)


def test_A6_a_command_lost_after_an_acknowledgement_is_reported_again(active: Bench) -> None:
    for _ in range(2):
        active.gripper.mute = True
        active.move(200, 128, 60)
        active.steps(8)
        assert active.session.command_lost
        active.session.acknowledge()
        assert not active.session.command_lost
        active.gripper.mute = False
        active.steps(8)


def test_a_second_halt_keeps_the_force_that_is_repeated_after_the_first(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    active.gripper.mute = True
    active.set_force(90)
    active.steps(1)
    active.move(0, 255, 0)
    halt(active.session)
    active.gripper.mute = False
    active.steps(1)
    assert (halt(active.session), active.session.force_sent_n) == (True, 91.0)
    active.steps(3)
    assert active.gripper.output == (0x0100, 200, 0x805A)


def test_an_unanswered_force_is_not_repeated_after_an_activation(active: Bench) -> None:
    active.move(200, 128, 60)
    active.steps(1)
    active.gripper.mute = True
    active.set_force(90)
    active.steps(1)
    activate(active.session, active.now_ns)
    active.gripper.mute = False
    active.steps(8)
    assert active.commands() == [GO, FORCE, CLEAR, ACTIVATE]
    assert (active.session.state, active.session.force_sent_n) == ("active", None)


@pytest.mark.parametrize("how", ["halt", "drop"])
def test_a_status_received_during_a_queued_activation_counts_after_its_cancellation(how: str) -> None:
    bench = Bench().start()
    activate(bench.session, bench.now_ns)
    bench.gripper.output, bench.gripper.stage = (0x0100, 0, 0), 3  # another master activated it
    poll = bench.session._line.poll(bench.now_ns)
    bench.session.receive(bench.gripper.respond(poll), bench.now_ns)
    assert (bench.session.state, bench.session.activating) == ("activating", True)
    assert forget(bench.session, how)
    assert (bench.session.state, bench.session.activating) == ("active", False)


def test_a_move_is_refused_until_the_activation_is_over_and_the_state_shows_it() -> None:
    bench = Bench().start()
    assert not bench.session.activating
    activate(bench.session, bench.now_ns)
    for _ in range(3):
        assert (bench.session.activating, bench.session.state) == (True, "activating")
        assert (bench.move(1, 2, 3), bench.set_force(4)) == (None, None)
        bench.steps(1)
    bench.steps(1)
    assert (bench.session.activating, bench.move(1, 2, 3)) == (False, 4.0)


def test_an_activation_that_the_gripper_refuses_is_over(active: Bench) -> None:
    activate(active.session, active.now_ns)
    active.steps(1)
    active.gripper.refuses = (modbus.WRITE,)
    active.steps(1)
    assert (active.session.activating, active.session.state) == (False, "command lost")
    active.steps(1)
    assert active.commands() == [CLEAR, ACTIVATE]
