"""The emulated WSG: moving jaws, blocked jaws, and how it answers invalid commands."""

from __future__ import annotations

import pytest
from driving import drive
from nanoseconds import MS
from permits import move

from slipd.devices.wsg import Decoder, Session
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_messages import Reply
from slipd.tools.sim import emulated_wsg as sim
from slipd.tools.sim.emulated_wsg import LIMITS, Gripper

Answers = list[tuple[int, int]]


def read(said: list[bytes]) -> list[Reply]:
    return Decoder().messages(b"".join(said))


def ask(gripper: Gripper, request: bytes | None, t_ns: int = 0) -> Answers:
    """Return identity and status of the replies to a request, or of what it sends unasked."""
    said = gripper.advance(t_ns) if request is None else gripper.receive(request, t_ns)
    return [(reply.id, reply.status) for reply in read(said)]


def told(gripper: Gripper, request: bytes, t_ns: int = 0) -> bytes:
    return read(gripper.receive(request, t_ns))[-1].data


def to(width_mm: float, mm_per_s: float = 100.0) -> bytes:
    return wire.preposition(width_mm, mm_per_s)


@pytest.fixture
def gripper() -> Gripper:
    made = Gripper()
    made.opened(0)
    return made


PENDING, DONE, BLOCKED, ABORTED, NOT_READY = (
    [(wire.PREPOSITION, status)]
    for status in (wire.PENDING, wire.OK, wire.AXIS_BLOCKED, wire.ABORTED, sim.NOT_INITIALISED)
)
STOP, STOPPED = wire.encode(wire.STOP), [(wire.STOP, wire.OK)]
ANEW = b"a host that comes while the one before has not taken leave"
Steps = list[tuple[int, bytes | None, Answers]]
COURSES: dict[str, tuple[Steps, float, set[str]]] = {
    "a motion is pending": ([(0, to(30.0), PENDING), (200, None, [])], 40.0, {"moving"}),
    "until the jaws are there": (
        [(0, to(30.0), PENDING), (200, None, []), (300, None, DONE)], 30.0, {"target_reached"},
    ),
    "a part blocks the jaws": (
        [(0, to(0.0), PENDING), (999, None, BLOCKED)], 20.0, {"target_reached", "blocked_minus"},
    ),
    "which open again": (
        [(0, to(0.0), PENDING), (999, None, BLOCKED), (999, to(80.0), PENDING), (1999, None, DONE)],
        *(80.0, {"target_reached"}),
    ),
    "a newer motion aborts the older": (
        [(0, to(0.0, 10.0), PENDING), (0, to(90.0, 10.0), [*ABORTED, *PENDING])], 60.0, {"moving"},
    ),
    "a stop aborts it too": (
        [(0, to(0.0), PENDING), (100, STOP, [*ABORTED, *STOPPED]), (200, STOP, STOPPED)], 50.0, {"target_reached"},
    ),
    "who leaves without a word makes it stop fast": (
        [(0, to(0.0), PENDING), (100, ANEW, []), (100, to(0.0), NOT_READY)], 60.0, {"target_reached", "fast_stop"},
    ),
    "until that is acknowledged": (
        [(0, ANEW, []), (100, wire.ACKNOWLEDGEMENT, [(wire.ACKNOWLEDGE, wire.OK)]), (100, to(50.0), PENDING)],
        *(60.0, {"moving"}),
    ),
    "who takes leave does not": (
        [(0, wire.encode(wire.DISCONNECT), [(wire.DISCONNECT, wire.OK)]), (100, ANEW, [])], 60.0, {"target_reached"},
    ),
}  # fmt: skip
"""Times in ms with requests and answers, and width and state at the end; a part of 20 mm is between the jaws."""


@pytest.mark.parametrize("course", COURSES)
def test_it_moves_and_says_how_it_ended(gripper: Gripper, course: str) -> None:
    steps, width_mm, state = COURSES[course]
    gripper.part_m = 0.02
    for ms, request, answers in steps:
        if request is ANEW:
            gripper.opened(ms * MS)
        else:
            assert ask(gripper, request, ms * MS) == answers
    shown = wire.parse_state(told(gripper, wire.encode(wire.STATE, bytes(3)), ms * MS))
    assert (gripper.width_mm, shown - {"referenced"}) == (pytest.approx(width_mm), state)


def test_a_gripper_without_reference_must_be_homed_first() -> None:
    gripper = Gripper()
    gripper.words.clear()
    assert ask(gripper, to(0.0)) == NOT_READY
    assert ask(gripper, wire.SEARCH_REFERENCE) == [(wire.HOME, wire.PENDING)]
    assert gripper.advance(1000 * MS) == [sim.encode_reply(wire.HOME)]
    assert (gripper.width_mm, gripper.words) == (LIMITS.stroke_mm, {"referenced"})


@pytest.mark.parametrize(("newtons", "status"), [(4.9, sim.RANGE_ERROR), (80.0, wire.OK), (81.0, sim.RANGE_ERROR)])
@pytest.mark.parametrize("overdrive", [False, True])
def test_a_force_beyond_its_limits_is_refused(gripper: Gripper, newtons: float, status: int, overdrive: bool) -> None:
    if overdrive:
        assert ask(gripper, wire.ALLOW_OVERDRIVE) == [(wire.OVERDRIVE, wire.OK)]
        newtons *= 1.5 if newtons > LIMITS.min_force else 1.0
    assert ask(gripper, wire.set_force(newtons)) == [(wire.SET_FORCE, status)]
    known = wire.parse_number(told(gripper, wire.encode(wire.GET_FORCE)))
    assert known == (newtons if status == wire.OK else 80.0)


def test_updates_come_at_their_periods_until_the_line_is_opened_anew(gripper: Gripper) -> None:
    for update in wire.UPDATES:
        assert ask(gripper, wire.update_request(update, 20)) == [(update, wire.OK)]
    assert sorted(reply.id for reply in read(gripper.advance(100 * MS))) == sorted(5 * wire.UPDATES)
    gripper.opened(100 * MS)
    assert gripper.advance(200 * MS) == []


def test_it_reports_identity_and_settings_and_refuses_unknown_commands(gripper: Gripper) -> None:
    assert wire.parse_limits(told(gripper, wire.encode(wire.LIMITS))) == LIMITS
    assert wire.SYSTEM_FIELDS.unpack(told(gripper, wire.encode(wire.SYSTEM)))[3] == 4711
    assert gripper.receive(wire.encode(0x36), 0) == [sim.encode_reply(0x36, sim.UNKNOWN_COMMAND)]
    assert ask(gripper, wire.encode(wire.HOME)) == [(wire.HOME, sim.NOT_ENOUGH_PARAMETERS)]
    assert ask(gripper, wire.encode(wire.HOME, bytes(2))) == [(wire.HOME, sim.NO_PARAMETER_EXPECTED)]


def test_the_session_grips_and_takes_leave(gripper: Gripper) -> None:
    session = Session(5)
    gripper.part_m = 0.02
    drive(session, gripper, 1.0)
    assert (session.state, session.identity) == ("active", "S/N 4711")
    assert move(session, 0.01, 0.4, 10.0) == 10.0
    held = drive(session, gripper, 1.0, begin_ns=1000 * MS, start=False)[-1]
    assert (held.width_m, held.object, held.echo_ok) == (0.02, "contact_closing", True)
    assert (session.command_lost, session.health.bad, session.health.lost) == (False, 0, 0)
    force = told(gripper, wire.encode(wire.FORCE, bytes(3)), 2000 * MS)
    assert wire.parse_number(force) == 20.0, "of both fingers"
    assert sim.encode_reply(wire.DISCONNECT) in gripper.receive(session.stop(), 2000 * MS)
