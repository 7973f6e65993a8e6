"""The WSG session with its emulator, and with answers that the emulator never gives."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import permutations
from typing import Any

import pytest
from permits import activate, forget, halt, move, set_force

from slipd.devices.shared.command_queue import ATTEMPTS
from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE, Packet, PacketScanner
from slipd.devices.wsg import Decoder, Session
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_command_queue import ANSWER_NS
from slipd.devices.wsg.wsg_session import HOMING_NS
from slipd.samples import GripperSample
from slipd.sim.emulated_wsg import LIMITS, Gripper, make

SplitCheck = Callable[[Callable[[], Any], bytes], list[tuple[Any, ...]]]
MS = 1_000_000
GO = (wire.SET_FORCE, wire.PREPOSITION, wire.GET_FORCE)


def updates(width_mm: float = 40.0, force: float = 20.0, words: tuple[str, ...] = ("referenced",)) -> list[bytes]:
    return [
        wire.encode_number(wire.WIDTH, width_mm),
        wire.encode_number(wire.FORCE, force),
        wire.encode_grasping("idle"),
        wire.encode_state(set(words)),
    ]


@dataclass
class Bench:
    """A session and a gripper, with a delay of a millisecond; keeps what the session sends, and may swallow it."""

    session: Session = field(default_factory=Session)
    gripper: Gripper = field(default_factory=lambda: make(0))
    now_ns: int = 0
    samples: list[GripperSample] = field(default_factory=list)
    sent: list[Packet] = field(default_factory=list)
    swallow: Callable[[Packet], bool] = lambda _: False
    mute: bool = False
    forge: Callable[[int], int | None] = lambda _: None

    def start(self) -> Bench:
        self.gripper.opened(self.now_ns)
        self.write(self.session.start(self.now_ns))
        return self.run(0.3)

    def write(self, data: bytes) -> None:
        for packet in PacketScanner(SEED_WITH_PREAMBLE, lambda *_: True, 9, Decoder().health).packets(data):
            self.sent.append(packet)
            if self.swallow(packet):
                continue
            forged = self.forge(packet.id)
            answers = self.gripper.receive(wire.encode(*packet), self.now_ns) if forged is None else []
            self.deliver(answers if forged is None else [wire.encode_reply(packet.id, forged)])

    def deliver(self, pieces: list[bytes]) -> None:
        for piece in [] if self.mute else pieces:
            self.samples += self.session.receive(piece, self.now_ns)

    def run(self, seconds: float) -> Bench:
        for _ in range(round(seconds * 1000)):
            self.now_ns += MS
            self.deliver(self.gripper.advance(self.now_ns))
            while (due := self.session.next_deadline()) is not None and due <= self.now_ns:
                self.write(self.session.on_time(self.now_ns))
        return self

    @property
    def last(self) -> GripperSample:
        return self.samples[-1]

    def commands(self) -> list[int]:
        return [packet.id for packet in self.sent if packet.id < wire.STATE]


@pytest.fixture
def bench() -> Bench:
    made = Bench().start()
    assert made.session.state == "active"
    made.sent.clear()
    return made


@pytest.fixture
def holding(bench: Bench) -> Bench:
    bench.gripper.part_mm = 40.0
    assert move(bench.session, 0.0, 0.2, 10.0) == 10.0
    bench.run(0.5)
    assert (bench.last.object, bench.last.moving) == ("contact_closing", False)
    bench.sent.clear()
    return bench


def test_starting_sends_queries_and_moves_nothing() -> None:
    bench = Bench().start().run(1.0)
    assert [packet.id for packet in bench.sent] == [wire.SYSTEM, wire.LIMITS, *wire.UPDATES]
    assert bench.session.identity == "S/N 4711"
    assert bench.session.stop() == bytes.fromhex("AA AA AA 07 00 00 35 4C")
    assert (bench.session.state, bench.session.next_deadline(), bench.session.identity) == ("closed", None, "")


def test_updates_arrive_at_the_period_in_complete_rounds(bench: Bench) -> None:
    bench.samples.clear()
    bench.run(1.0)
    assert len(bench.samples) == 50
    assert (bench.session.health.lost, bench.session.health.bad) == (0, 0)
    assert (bench.last.width_m, bench.last.active, bench.last.fault) == (0.06, True, "")
    assert (bench.last.echo_ok, bench.last.current_a) == (None, None)


def test_the_ranges_are_those_of_the_gripper_on_one_pad(bench: Bench) -> None:
    session = bench.session
    assert session.width_range_m == (0.0, pytest.approx(0.110))
    assert session.speed_range_mps == (pytest.approx(0.005), pytest.approx(0.420))
    assert session.force_range_n == (2.5, 40.0), "up to the nominal force, not the overdrive"
    session.stop()
    assert (session.width_range_m, session.speed_range_mps, session.force_range_n) == (
        (0.0, math.inf),
        None,
        (0.0, math.inf),
    )


def test_the_force_on_one_pad_is_half_of_what_the_gripper_receives_and_sends(holding: Bench) -> None:
    assert holding.gripper.limit == 20.0
    assert holding.last.force_n == 10.0
    assert set_force(holding.session, 15.0) == 15.0
    holding.run(0.1)
    assert holding.sent[0] == Packet(wire.SET_FORCE, wire.set_force(30.0)[6:-2])
    assert (holding.gripper.limit, holding.last.force_n) == (30.0, 15.0)


def test_a_move_sets_the_force_before_it_goes_and_reads_it_back(bench: Bench) -> None:
    assert move(bench.session, 0.02, None, 10.0) == 10.0
    bench.run(0.5)
    assert bench.commands() == list(GO)
    assert wire.parse_goal(bench.sent[1].payload) == (0, 20.0, 210.0)
    assert (bench.last.width_m, bench.last.object, bench.last.echo_ok) == (pytest.approx(0.02), "none", True)


@pytest.mark.parametrize(("requested", "sent"), [(0.1, 2.5), (39.0, 39.0), (60.0, 40.0), (7.1, wire.at_most(14.2) / 2)])
def test_no_more_force_is_sent_than_requested_except_the_smallest(bench: Bench, requested: float, sent: float) -> None:
    assert move(bench.session, 0.02, None, requested) == sent
    bench.run(0.1)
    assert bench.gripper.limit == 2 * sent


def test_a_force_while_holding_clamps_again_with_the_goal_that_made_the_grip(holding: Bench) -> None:
    set_force(holding.session, 12.0)
    holding.run(0.3)
    assert holding.commands() == list(GO)
    assert wire.parse_goal(holding.sent[1].payload) == (0, 0.0, 200.0)
    assert (holding.last.width_m, holding.last.object) == (0.04, "contact_closing")


def test_a_force_after_a_restart_of_the_daemon_sets_the_limit_alone(holding: Bench) -> None:
    holding.write(holding.session.stop())
    holding.start()
    holding.sent.clear()
    assert (holding.session.force_sent_n, set_force(holding.session, 12.0)) == (None, 12.0)
    holding.run(0.3)
    assert holding.commands() == [wire.SET_FORCE, wire.GET_FORCE]
    assert (holding.last.width_m, holding.last.force_n) == (0.04, 12.0)


def test_a_force_while_nothing_is_held_and_no_goal_is_known_moves_nothing(bench: Bench) -> None:
    assert set_force(bench.session, 12.0) == 12.0
    bench.run(0.3)
    assert bench.commands() == [wire.SET_FORCE, wire.GET_FORCE]
    assert bench.last.width_m == 0.06


@pytest.mark.parametrize("blocked", ["blocked_plus", "blocked_minus"])
@pytest.mark.parametrize("width_m", [None, 0.1])
def test_a_force_never_opens_or_resumes_after_a_stop(bench: Bench, blocked: str, width_m: float | None) -> None:
    if width_m is not None:  # an obstacle blocks the opening
        move(bench.session, width_m, 0.05, 10.0)
        bench.run(0.1)
        bench.gripper.receive(wire.encode(wire.STOP), bench.now_ns)
    else:
        move(bench.session, 0.0, 0.05, 10.0)
        bench.run(0.1)
        halt(bench.session)
    bench.gripper._blocked = blocked
    bench.run(0.1)
    stood_m = bench.last.width_m
    bench.sent.clear()
    assert set_force(bench.session, 12.0) == 12.0
    bench.run(1.0)
    assert bench.commands() == [wire.SET_FORCE, wire.GET_FORCE]
    assert (bench.last.width_m, bench.gripper.limit) == (stood_m, 24.0)


def test_a_force_after_a_move_that_was_lost_does_not_begin_it(bench: Bench) -> None:
    bench.swallow = lambda packet: packet.id == wire.SET_FORCE
    move(bench.session, 0.0, None, 10.0)
    bench.run(ANSWER_NS * 1e-9 * ATTEMPTS + 0.1)
    assert bench.session.command_lost
    bench.swallow = lambda _: False
    set_force(bench.session, 12.0)
    bench.run(0.5)
    assert (bench.last.width_m, bench.session.command_lost) == (0.06, False)


def test_a_force_after_a_waiting_move_is_sent_with_the_move(bench: Bench) -> None:
    move(bench.session, 0.1, None, 40.0)
    set_force(bench.session, 5.0)
    bench.run(0.5)
    assert bench.commands() == list(GO)
    assert (bench.last.width_m, bench.gripper.limit) == (pytest.approx(0.1), 10.0)


@pytest.mark.parametrize("how", ["halt", "drop"])
def test_the_force_sent_is_the_one_in_effect_once_waiting_commands_are_dropped(holding: Bench, how: str) -> None:
    assert holding.session.force_sent_n == 10.0
    set_force(holding.session, 12.0)
    holding.write(holding.session.on_time(holding.now_ns))
    holding.swallow = lambda _: True
    set_force(holding.session, 15.0)
    holding.write(holding.session.on_time(holding.now_ns))
    set_force(holding.session, 20.0)
    assert (holding.session.force_sent_n, forget(holding.session, how)) == (20.0, True)
    assert holding.session.force_sent_n == 15.0
    assert holding.session.drop() is False


def test_dropped_commands_are_not_sent_and_sent_ones_are_not_repeated(bench: Bench) -> None:
    bench.swallow = lambda _: True
    move(bench.session, 0.0, None, 10.0)
    bench.run(0.001)
    assert bench.session.drop()
    bench.run(ANSWER_NS * 1e-9 + 0.1)
    assert (bench.commands(), bench.session.state) == ([wire.SET_FORCE], "command lost: no answer to force limit")


def test_a_dropped_move_is_not_resumed_by_a_later_force(bench: Bench) -> None:
    move(bench.session, 0.0, None, 10.0)
    assert bench.session.drop()
    set_force(bench.session, 12.0)
    bench.run(0.5)
    assert bench.commands() == [wire.SET_FORCE, wire.GET_FORCE]


def test_a_stop_is_not_dropped(bench: Bench) -> None:
    move(bench.session, 0.0, 0.05, 10.0)
    bench.run(0.1)
    halt(bench.session)
    assert bench.session.drop() is False
    bench.run(0.1)
    assert bench.commands() == [*GO, wire.STOP]


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


def test_nothing_is_accepted_before_the_first_reading() -> None:
    session = Session()
    for _ in range(2):
        assert (activate(session), halt(session), session.drop(), session.activating) == (False, False, False, False)
        assert (move(session, 0.05, None, 5.0), set_force(session, 5.0)) == (None, None)
        session.start(0)
    session.on_time(0)
    assert not session.command_lost


def test_a_gripper_that_is_not_referenced_any_more_has_no_force(holding: Bench) -> None:
    holding.gripper.words.clear()
    holding.run(0.1)
    assert holding.session.force_sent_n is None


def test_a_stop_is_sent_before_all_else_and_nothing_resumes_after_it(bench: Bench) -> None:
    move(bench.session, 0.0, 0.1, 10.0)
    bench.run(0.1)
    set_force(bench.session, 20.0)
    assert halt(bench.session)
    set_force(bench.session, 15.0)
    bench.run(1.0)
    assert bench.commands() == [*GO, wire.STOP, wire.SET_FORCE, wire.GET_FORCE]
    assert 0.045 < bench.last.width_m < 0.055
    assert (bench.session.state, bench.last.echo_ok) == ("active", True)


def test_nothing_is_sent_before_it_is_due(bench: Bench) -> None:
    bench.swallow = lambda _: True
    set_force(bench.session, 10.0)
    bench.run(0.001)
    assert bench.session.next_deadline() == bench.now_ns + ANSWER_NS
    assert bench.session.on_time(bench.now_ns + ANSWER_NS - 1) == b""


def test_stop_does_not_wait_for_an_answer(bench: Bench) -> None:
    bench.swallow = lambda packet: packet.id == wire.SET_FORCE
    set_force(bench.session, 20.0)
    bench.run(0.002)
    halt(bench.session)
    bench.run(0.001)
    assert bench.commands() == [wire.SET_FORCE, wire.STOP]


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


@pytest.mark.parametrize("fault", wire.FAULTS)
def test_D4_a_fault_is_named_and_nothing_is_tried_against_it(holding: Bench, fault: str) -> None:
    holding.gripper.words.add(fault)
    holding.run(0.5)
    assert (holding.last.fault, holding.last.active, holding.commands()) == (fault, True, [])
    assert holding.session.state == fault
    assert (move(holding.session, 0.0, None, 5.0), set_force(holding.session, 5.0)) == (None, None)
    holding.session.acknowledge()
    holding.session.acknowledge()
    holding.run(0.1)
    assert (holding.commands(), holding.last.fault) == ([wire.ACKNOWLEDGE], "")
    assert set_force(holding.session, 12.0)


def test_D4_a_goal_from_before_a_fault_is_not_resumed(bench: Bench) -> None:
    move(bench.session, 0.1, 0.05, 5.0)
    bench.run(0.1)
    bench.gripper.receive(wire.encode(wire.STOP), bench.now_ns)
    bench.gripper.words.add("fast_stop")
    bench.run(0.1)
    bench.session.acknowledge()
    bench.run(0.1)
    width_m = bench.last.width_m
    assert set_force(bench.session, 10.0)
    bench.run(1.0)
    assert bench.last.width_m == width_m


def test_D4_a_command_that_meets_a_fault_is_dropped(bench: Bench) -> None:
    bench.swallow = lambda packet: packet.id == wire.SET_FORCE
    set_force(bench.session, 10.0)
    bench.run(0.1)
    bench.gripper.words.add("fast_stop")
    bench.run(1.0)
    assert bench.commands() == [wire.SET_FORCE]
    assert bench.session.state == "command lost: fast_stop"


def test_activation_acknowledges_a_fault_first(bench: Bench) -> None:
    bench.gripper.words.add("fast_stop")
    bench.run(0.1)
    activate(bench.session, bench.now_ns)
    bench.run(1.0)
    assert bench.commands() == [wire.ACKNOWLEDGE, wire.HOME]
    assert bench.session.state == "active"


def test_without_a_fault_nothing_is_acknowledged(bench: Bench) -> None:
    bench.session.acknowledge()
    bench.run(0.1)
    assert bench.commands() == []


def test_a_connection_that_broke_is_a_fault_of_the_gripper(holding: Bench) -> None:
    holding.start()
    assert (holding.last.fault, move(holding.session, 0.0, None, 5.0)) == ("fast_stop", None)


def test_D5_a_force_limit_that_is_read_back_differently_is_reported_while_it_lasts(bench: Bench) -> None:
    set_force(bench.session, 10.0)
    bench.run(0.1)
    assert bench.last.echo_ok is True
    bench.swallow = lambda packet: (
        packet.id == wire.SET_FORCE and not bench.deliver([wire.encode_reply(wire.SET_FORCE)])
    )
    set_force(bench.session, 20.0)
    bench.samples.clear()
    bench.run(1.0)
    assert [sample.echo_ok for sample in bench.samples[1:]] == [False] * (len(bench.samples) - 1)
    bench.swallow = lambda _: False
    set_force(bench.session, 20.0)
    bench.run(0.1)
    assert bench.last.echo_ok is True


def test_D5_a_limit_read_back_while_a_newer_one_waits_is_compared_with_its_own(bench: Bench) -> None:
    bench.swallow = lambda packet: packet.id == wire.GET_FORCE
    set_force(bench.session, 10.0)
    bench.run(0.01)
    set_force(bench.session, 20.0)
    bench.deliver([wire.encode_number(wire.GET_FORCE, 20.0)])
    bench.run(0.03)
    assert bench.last.echo_ok is True


@pytest.mark.parametrize("lost", GO)
def test_A6_an_unanswered_command_is_repeated_twice_and_then_lost(bench: Bench, lost: int) -> None:
    bench.swallow = lambda packet: packet.id == lost
    move(bench.session, 0.02, None, 10.0)
    bench.run(ANSWER_NS * 1e-9 * ATTEMPTS + 0.1)
    assert bench.commands() == [*GO[: GO.index(lost)], *[lost] * ATTEMPTS]
    assert bench.session.command_lost
    assert bench.session.state.startswith("command lost: no answer to ")
    assert bench.session.health.lost == ATTEMPTS
    bench.swallow = lambda _: False
    move(bench.session, 0.02, None, 10.0)
    bench.run(0.1)
    assert not bench.session.command_lost


def test_A6_a_command_that_a_newer_one_replaced_is_not_repeated(bench: Bench) -> None:
    bench.swallow = lambda packet: packet.id == wire.SET_FORCE
    set_force(bench.session, 10.0)
    bench.run(0.01)
    set_force(bench.session, 20.0)
    bench.run(0.01)
    bench.swallow = lambda _: False
    bench.run(ANSWER_NS * 1e-9)
    assert [wire.parse_number(packet.payload) for packet in bench.sent if packet.id == wire.SET_FORCE] == [20.0, 40.0]
    assert not bench.session.command_lost


@pytest.mark.parametrize("status", [*range(1, 26), *range(27, 31)])
@pytest.mark.parametrize("refused", GO)
def test_A6_every_refusal_is_reported_by_its_word_and_not_repeated(bench: Bench, refused: int, status: int) -> None:
    bench.forge = lambda asked: status if asked == refused else None
    move(bench.session, 0.02, None, 10.0)
    bench.run(0.1)
    well = refused == wire.PREPOSITION and status in (wire.ABORTED, wire.AXIS_BLOCKED)
    assert bench.session.command_lost is not well
    assert well or bench.commands()[-1] == refused
    assert well or bench.session.state.startswith("command lost: ")


@pytest.mark.parametrize(("status", "lost"), [(0, False), (19, False), (29, False), (7, True), (18, True)])
def test_the_end_of_a_motion_may_come_at_any_time(bench: Bench, status: int, lost: bool) -> None:
    bench.deliver([wire.encode_reply(wire.PREPOSITION, status)])
    assert bench.session.command_lost is lost


def test_unrequested_answers_change_nothing(bench: Bench) -> None:
    bench.deliver([wire.encode_reply(reply_id) for reply_id in (wire.STOP, wire.SET_FORCE, wire.ACKNOWLEDGE)])
    bench.deliver([wire.encode_number(wire.GET_FORCE, 3.0), wire.encode_limits(LIMITS._replace(nominal_force=90.0))])
    assert (bench.session.state, bench.session.force_range_n[1]) == ("active", 40.0)


def test_the_abort_of_an_older_motion_does_not_answer_the_newer(bench: Bench) -> None:
    move(bench.session, 0.0, 0.01, 10.0)
    bench.run(0.1)
    move(bench.session, 0.05, 0.1, 10.0)
    bench.run(0.5)
    assert bench.commands() == [*GO, *GO]
    assert (bench.last.width_m, bench.session.state) == (pytest.approx(0.05), "active")


def test_a_silent_gripper_is_configured_again_and_its_commands_are_dropped(bench: Bench) -> None:
    bench.mute = True
    bench.run(0.9)
    activate(bench.session, bench.now_ns)
    bench.run(1.1)
    assert bench.session.state == "no reply"
    assert (move(bench.session, 0.0, None, 5.0), halt(bench.session), bench.session.command_lost) == (None, False, True)
    bench.mute = False
    bench.sent.clear()
    bench.run(3.0)
    assert bench.commands() == []
    assert move(bench.session, 0.02, None, 5.0) == 5.0


def test_a_refused_query_is_repeated() -> None:
    bench = Bench(forge=lambda asked: 10 if asked == wire.LIMITS else None).start()
    assert bench.session.state == "refused limits: insufficient resources"
    assert move(bench.session, 0.0, None, 5.0) is None
    bench.forge = lambda _: None
    bench.run(2.0)
    assert bench.session.state == "active"


def test_warnings_of_the_gripper_follow_its_state(bench: Bench) -> None:
    bench.gripper.words |= {"temperature_warning", "script_running"}
    bench.run(0.1)
    assert bench.session.state == "active (temperature_warning, script_running)"
    assert bench.last.fault == ""


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_N2_a_force_that_is_not_finite_is_refused(bench: Bench, value: float) -> None:
    for ask in (lambda: move(bench.session, 0.0, None, value), lambda: set_force(bench.session, value)):
        with pytest.raises(ValueError, match="must be finite"):
            ask()


@pytest.mark.parametrize("value", [-0.001, 0.5, math.nan])
def test_a_width_or_speed_that_the_gripper_does_not_have_is_refused(bench: Bench, value: float) -> None:
    with pytest.raises(ValueError, match=r"the width must be from 0 to 0\.11 m, got"):
        move(bench.session, value, None, 5.0)
    with pytest.raises(ValueError, match=r"the speed must be from 0\.005 to 0\.42 m/s, got"):
        move(bench.session, 0.05, value, 5.0)
    bench.run(0.1)
    assert bench.commands() == []


@pytest.mark.parametrize("period", [4, 201, 20.0])
def test_a_period_that_no_gripper_keeps_is_refused(period: Any) -> None:
    with pytest.raises(ValueError, match="5 to 200"):
        Session(period)


def test_L1_every_split_reads_the_same(same_for_every_split: SplitCheck) -> None:
    rounds = [updates(width) for width in (40.0, 41.0, 42.0)]
    stream = b"".join([*rounds[0], b"\xaa\xaa", *rounds[1][:2], wire.encode_reply(wire.HOME), *rounds[2], *rounds[1]])
    samples = same_for_every_split(Decoder, stream)
    assert [sample[3] for sample in samples] == [pytest.approx(0.04), pytest.approx(0.042), pytest.approx(0.041)]


def test_an_update_that_is_missing_costs_one_reading_and_only_it() -> None:
    for order in permutations(range(4)):
        for missing in order:
            decoder = Decoder()
            parts = updates()
            whole = b"".join(parts[at] for at in order)
            torn = b"".join(parts[at] for at in order if at != missing)
            samples = decoder.receive(2 * whole + torn + 3 * whole, 0)
            joined_late = order[-1] != 3  # the first state arrived before the other updates
            assert len(samples) == 5 - joined_late, (order, missing)


def test_updates_of_two_periods_are_not_mixed() -> None:
    first, second, third = updates(40.0), updates(41.0), updates(42.0)
    decoder = Decoder()
    samples = decoder.receive(b"".join([*first[:3], *second[1:], *third]), 0)
    assert [sample.width_m for sample in samples] == [pytest.approx(0.042)]


def test_D4_the_state_bits_determine_the_sample() -> None:
    def read(*words: str, grasping: str = "idle") -> GripperSample:
        parts = updates(words=words)
        parts[2] = wire.encode_grasping(grasping)
        (sample,) = Decoder().receive(b"".join(parts), 5)
        return sample

    assert (read().active, read("referenced").active) == (False, True)
    assert read("blocked_minus").object == read(grasping="holding").object == "contact_closing"
    assert (read("moving").object, read("moving").moving, read().object) == ("moving", True, "none")
    for word in wire.STATE_BITS.values():
        assert read(word).fault == (word if word in wire.FAULTS else "")
    assert (read().force_n, read().width_m, read().t_ns, read().echo_ok) == (10.0, pytest.approx(0.04), 5, None)


def test_L5_a_round_cut_by_a_closed_line_is_not_completed_by_the_next() -> None:
    decoder = Decoder()
    parts = updates()
    decoder.receive(b"".join(parts[:3]), 0)
    decoder.forget()
    assert decoder.receive(parts[3], 0) == []


def test_a_force_is_sent_as_requested() -> None:
    assert Session().applied_n(12.34) == 12.34


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


def test_a_fault_that_is_acknowledged_while_the_gripper_is_silent_sends_and_loses_nothing(bench: Bench) -> None:
    bench.gripper.words.add("fast_stop")
    bench.run(0.1)
    bench.mute = True
    bench.run(1.5)
    bench.session.acknowledge()
    bench.run(0.1)
    assert (bench.commands(), bench.session.command_lost) == ([], False)
