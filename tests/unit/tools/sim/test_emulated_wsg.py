"""The emulated WSG: moving jaws, blocked jaws, and how it answers invalid commands."""

from __future__ import annotations

import pytest
from driving import drive
from permits import move

from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.wsg import Session
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_decoder import Reply, ReplyScanner
from slipd.tools.sim import emulated_wsg as sim
from slipd.tools.sim.emulated_wsg import LIMITS, Gripper, make

MS = 1_000_000


@pytest.fixture
def gripper() -> Gripper:
    made = make(0)
    made.opened(0)
    return made


def read(said: list[bytes]) -> list[Reply]:
    return ReplyScanner(DecoderHealth()).replies(b"".join(said))


def ask(gripper: Gripper, request: bytes, t_ns: int = 0) -> list[tuple[int, int]]:
    return [(reply.id, reply.status) for reply in read(gripper.receive(request, t_ns))]


def words(gripper: Gripper, t_ns: int) -> frozenset[str]:
    return wire.parse_state(read(gripper.receive(wire.encode(wire.STATE, bytes(3)), t_ns))[-1].data)


def test_a_motion_is_pending_until_the_jaws_are_there(gripper: Gripper) -> None:
    assert ask(gripper, wire.preposition(30.0, 100.0)) == [(wire.PREPOSITION, wire.PENDING)]
    assert gripper.advance(200 * MS) == []
    assert gripper.width_mm == pytest.approx(40.0)
    assert words(gripper, 200 * MS) == {"referenced", "moving"}
    assert gripper.advance(300 * MS) == [sim.encode_reply(wire.PREPOSITION)]
    assert (gripper.width_mm, words(gripper, 300 * MS)) == (30.0, {"referenced", "target_reached"})


def test_a_part_blocks_the_jaws_and_feels_the_force_limit_of_both(gripper: Gripper) -> None:
    gripper.part_mm = 40.0
    ask(gripper, wire.set_force(20.0))
    ask(gripper, wire.preposition(0.0, 100.0))
    assert read(gripper.advance(1000 * MS)) == [Reply(wire.PREPOSITION, wire.AXIS_BLOCKED, b"")]
    assert gripper.width_mm == 40.0
    assert "blocked_minus" in words(gripper, 1000 * MS)
    (force,) = read(gripper.receive(wire.encode(wire.FORCE, bytes(3)), 1000 * MS))
    assert wire.parse_number(force.data) == 20.0
    ask(gripper, wire.preposition(80.0, 100.0), 1000 * MS)
    gripper.advance(2000 * MS)
    assert gripper.width_mm == 80.0


def test_stop_and_a_newer_motion_abort_the_older(gripper: Gripper) -> None:
    aborted = (wire.PREPOSITION, wire.ABORTED)
    ask(gripper, wire.preposition(0.0, 10.0))
    assert ask(gripper, wire.preposition(90.0, 10.0)) == [aborted, (wire.PREPOSITION, wire.PENDING)]
    assert ask(gripper, wire.encode(wire.STOP)) == [aborted, (wire.STOP, wire.OK)]
    assert ask(gripper, wire.encode(wire.STOP)) == [(wire.STOP, wire.OK)]


def test_a_gripper_without_reference_must_be_homed_first() -> None:
    gripper = Gripper()
    gripper.opened(0)
    assert ask(gripper, wire.preposition(0.0, 10.0)) == [(wire.PREPOSITION, wire.NOT_INITIALISED)]
    assert ask(gripper, wire.home()) == [(wire.HOME, wire.PENDING)]
    assert gripper.advance(1000 * MS) == [sim.encode_reply(wire.HOME)]
    assert (gripper.width_mm, gripper.words) == (LIMITS.stroke_mm, {"referenced"})


@pytest.mark.parametrize(("newtons", "status"), [(4.9, wire.RANGE_ERROR), (80.0, wire.OK), (81.0, wire.RANGE_ERROR)])
@pytest.mark.parametrize("overdrive", [False, True])
def test_a_force_beyond_its_limits_is_refused(gripper: Gripper, newtons: float, status: int, overdrive: bool) -> None:
    if overdrive:
        assert ask(gripper, wire.overdrive()) == [(wire.OVERDRIVE, wire.OK)]
        newtons *= 1.5 if newtons > LIMITS.min_force else 1.0
    assert ask(gripper, wire.set_force(newtons)) == [(wire.SET_FORCE, status)]
    (told,) = read(gripper.receive(wire.encode(wire.GET_FORCE), 0))
    assert wire.parse_number(told.data) == (newtons if status == wire.OK else 80.0)


def test_who_leaves_without_a_word_makes_it_stop_fast_until_that_is_acknowledged(gripper: Gripper) -> None:
    ask(gripper, wire.preposition(0.0, 100.0))
    gripper.opened(100 * MS)
    assert "fast_stop" in words(gripper, 100 * MS)
    assert ask(gripper, wire.preposition(0.0, 100.0), 100 * MS) == [(wire.PREPOSITION, wire.NOT_INITIALISED)]
    assert ask(gripper, wire.acknowledge(), 100 * MS) == [(wire.ACKNOWLEDGE, wire.OK)]
    assert ask(gripper, wire.encode(wire.DISCONNECT), 100 * MS) == [(wire.DISCONNECT, wire.OK)]
    gripper.opened(200 * MS)
    assert words(gripper, 200 * MS) == {"referenced", "target_reached"}


def test_updates_come_at_their_periods_until_the_line_is_opened_anew(gripper: Gripper) -> None:
    for update in wire.UPDATES:
        assert ask(gripper, wire.update_request(update, 20)) == [(update, wire.OK)]
    assert sorted(reply.id for reply in read(gripper.advance(100 * MS))) == sorted(5 * wire.UPDATES)
    gripper.opened(100 * MS)
    assert gripper.advance(200 * MS) == []


def test_it_reports_identity_and_settings_and_refuses_unknown_commands(gripper: Gripper) -> None:
    limits, system = read(gripper.receive(wire.encode(wire.LIMITS) + wire.encode(wire.SYSTEM), 0))
    assert wire.parse_limits(limits.data) == LIMITS
    assert wire.parse_serial(system.data) == 4711
    assert gripper.receive(wire.encode(0x36), 0) == [sim.encode_reply(0x36, wire.UNKNOWN_COMMAND)]
    assert ask(gripper, wire.encode(wire.HOME)) == [(wire.HOME, wire.NOT_ENOUGH_PARAMETERS)]
    assert ask(gripper, wire.encode(wire.HOME, bytes(2))) == [(wire.HOME, wire.NO_PARAMETER_EXPECTED)]


def test_the_session_grips_and_takes_leave(gripper: Gripper) -> None:
    session = Session(5)
    gripper.part_mm = 20.0
    drive(session, gripper, 1.0)
    assert (session.state, session.identity) == ("active", "S/N 4711")
    assert move(session, 0.01, 0.4, 10.0) == 10.0
    held = drive(session, gripper, 1.0, begin_ns=1000 * MS, start=False)[-1]
    assert (held.width_m, held.object, held.echo_ok) == (0.02, "contact_closing", True)
    assert (session.command_lost, session.health.bad, session.health.lost) == (False, 0, 0)
    assert sim.encode_reply(wire.DISCONNECT) in gripper.receive(session.stop(), 2000 * MS)
