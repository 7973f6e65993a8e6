"""One table of rules decides on every motion: each rule by itself, and no motion bypasses the gate."""

from __future__ import annotations

import ast
import math
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from judging import LIMITS, READY

import slipd
from slipd.gripper.grip_gate import KINDS, judge, why_not_sent
from slipd.gripper.grip_policy import GripLimits, GripState, NoGripper
from slipd.gripper.intent import Intent, IntentKind, Situation
from slipd.types.permit import Permit, Refusal

FREE = GripState(
    holder=b"ann",
    fault="",
    force_n=None,
    unknown=False,
    releasing=False,
    requested_n=None,
    raise_left_n=2.0,
    lower_left_n=2.0,
    budget_left_n=12.0,
    reflex_left_n=12.0,
)
HELD = replace(FREE, force_n=6.0, requested_n=6.0)
MOVING: tuple[IntentKind, ...] = ("activate", "open", "close", "set", "adjust", "reflex")
FORCING: tuple[IntentKind, ...] = ("close", "set", "adjust", "reflex")
DAEMON = Path(slipd.__file__).parent


def situation(grip: GripState = FREE, limits: GripLimits = LIMITS, **changes: Any) -> Situation:
    fingers = {name: changes.pop(name) for name in ("blind", "not_free") if name in changes}
    return Situation(limits, grip, replace(READY, force_range_n=(2.0, 30.0), **changes), **fingers)


def intent(kind: IntentKind, **wanted: Any) -> Intent:
    """What the client that holds the lease wants; of a force, as of a gripper without steps."""
    force_n = wanted.get("force_wanted_n")
    usual = {"who": b"ann", "width_now_m": 0.05, "force_applied_n": force_n}
    return Intent(kind, **(usual | wanted))


def of(kind: IntentKind) -> Intent:
    """An intent that nothing speaks against while 6 N are in force."""
    if kind in FORCING:
        return intent(kind, force_in_force_n=6.0, force_wanted_n=7.0)
    return intent(kind, force_in_force_n=6.0, drop=True)


def code(found: Refusal | Permit | None) -> str:
    return found.code if isinstance(found, Refusal) else ""


MOVES = {"activate": "activate", "open": "move", "close": "move"} | dict.fromkeys(FORCING[1:], "set_force")
UNREADY = {
    "no_limit": situation(HELD, replace(LIMITS, max_n=None)),
    "fault_latched": situation(replace(HELD, fault="E-stop")),
    "no_gripper": situation(HELD, answers=False, active=False),
    "gripper_fault": situation(HELD, fault="overcurrent"),
    "not_active": situation(HELD, active=False),
    "activating": situation(HELD, active=False, activating=True),
}
BLIND, LET_GO = situation(HELD, blind=("right",)), situation(replace(HELD, releasing=True, unknown=True))
STOPPED: dict[str, Any] = {"answers": False, "active": False, "fault": "internal", "moving": True}
ANY = replace(of("close"), force_in_force_n=None)


def opens(wanted_m: float | None, now_m: float | None = 0.05, **more: Any) -> Intent:
    return intent("open", width_wanted_m=wanted_m, width_now_m=now_m, **more)


def closes(wanted_m: float | None, seen: Situation, now_m: float | None = 0.05) -> tuple[Intent, Situation]:
    force_n = seen.grip.force_n
    return (
        intent("close", width_wanted_m=wanted_m, width_now_m=now_m, force_wanted_n=6.0, force_in_force_n=force_n),
        seen,
    )


def forces(kind: IntentKind, wanted_n: float, held_n: float | None = 6.0) -> Intent:
    applied_n = wanted_n if math.isfinite(wanted_n) else None
    return intent(kind, force_wanted_n=wanted_n, force_applied_n=applied_n, force_in_force_n=held_n)


CASES: list[tuple[Intent, Situation, str | Permit | None]] = [
    # whoever moves holds the lease, but for the daemon itself
    *(
        (replace(of(kind), who=who), situation(replace(HELD, holder=holder), moving=True), "no_lease")
        for kind in KINDS if kind not in ("reflex", "lease_end")
        for who, holder in ((b"ann", b"ben"), (b"ann", None), (None, None))
    ),
    (replace(of("reflex"), who=None), situation(replace(HELD, holder=b"ben")), ""),
    (replace(of("lease_end"), who=None), situation(HELD, moving=True, stops_at_lease_end=True), Permit("halt")),
    # a gripper that is not ready is not moved; an activation may be what makes it ready
    *(
        (of(kind), seen, refused)
        for kind in MOVING for refused, seen in UNREADY.items()
        if kind != "activate" or refused not in ("gripper_fault", "not_active", "activating")
    ),
    *((of("activate"), UNREADY[what], Permit("activate")) for what in ("gripper_fault", "not_active", "activating")),
    # a force is within a step of the one that the gripper acknowledged
    *(
        (of(kind), situation(HELD, force_acknowledged_n=acts_n), refused)
        for kind in FORCING
        for acts_n, refused in ((None, ""), (5.0, ""), (9.0, ""), (4.9, "too_fast"), (9.1, "too_fast"))
    ),
    *((ANY, situation(force_acknowledged_n=acts_n), "") for acts_n in (None, 4.9, 9.1)),
    # stopping is never refused for what is wrong, and nothing is sent where nothing moves
    *(
        (
            of(kind),
            situation(replace(HELD, fault="E-stop"), replace(LIMITS, max_n=None), **STOPPED, stops_at_lease_end=True),
            Permit("halt"),
        )
        for kind in ("hold", "stop", "lease_end")
    ),
    (of("hold"), situation(HELD), None),
    (of("lease_end"), situation(HELD, stops_at_lease_end=True), None),
    (of("lease_end"), situation(HELD, moving=True, goals_m=(0.0, 0.0)), None),
    (of("stop"), situation(HELD), Permit("halt")),
    # what may fall is let go only for who accepts it
    *((intent(kind), situation(not_free=("left",)), "in_contact") for kind in ("open", "activate")),
    *((intent(kind, drop=True), situation(not_free=("left",)), "") for kind in ("open", "activate")),
    # a force is within the limits, known, and raised only where it is felt
    *((forces(kind, force_n), situation(HELD), "out_of_range") for kind in FORCING for force_n in (2.9, 25.1, -1.0)),
    *((forces(kind, force_n), situation(HELD), "not_finite") for kind in FORCING for force_n in (math.nan, math.inf)),
    # what asks for no force breaks no limit
    (intent("close", force_in_force_n=6.0), situation(HELD), Permit("move", 0.0)),
    *((forces(kind, 6.5), BLIND, "not_ready") for kind in FORCING),
    *((forces(kind, 5.5), BLIND, "not_ready" if kind == "reflex" else "") for kind in FORCING),
    (forces("close", 20.0, None), situation(blind=("right",)), Permit("move", 0.0, None, 20.0)),
    *(
        (forces(kind, force_n, None), situation(replace(FREE, unknown=True)), "not_ready")
        for kind in FORCING for force_n in (3.0, 6.0, 25.0)
    ),
    (forces("close", 25.0, 3.0), LET_GO, "not_ready"),
    *((forces(kind, 6.0, None), LET_GO, "not_ready") for kind in FORCING[1:]),
    # the reflex lowers no further than requested, and may raise below it
    *(
        (forces("reflex", wanted_n, now_n), situation(replace(HELD, force_n=now_n, requested_n=8.0)), refused)
        for now_n, wanted_n, refused in (
            (6.0, 6.5, ""), (6.0, 6.0, ""), (9.0, 8.0, ""), (9.0, 8.0 - 1e-9, ""), (9.0, 7.9, "out_of_range"),
        )
    ),
    # open only widens: a width is at least the widest that the fingers may be
    (opens(0.0499), situation(), "out_of_range"),
    (opens(0.0499, drop=True), situation(not_free=("left",)), "out_of_range"),
    (opens(0.05), situation(), Permit("move", 0.05, None, 3.0)),
    *((opens(None, now_m), situation(), Permit("move", 0.085, None, 3.0)) for now_m in (None, 0.0, 0.0855)),
    (opens(0.085, 0.0855), situation(), Permit("move", 0.085, None, 3.0)),
    (opens(0.08, None), situation(), "not_ready"),
    *(
        (opens(wanted_m), situation(moving=True, goals_m=goals_m), refused)
        for goals_m, wanted_m, refused in (
            ((0.08, 0.08), 0.07, "out_of_range"),  # they may be there already
            ((0.08, 0.08), 0.08, ""),
            ((0.02, 0.02), 0.049, "out_of_range"),  # they close, and may have got no further than this
            ((0.02, 0.02), 0.05, ""),
            ((0.02, 0.08), 0.07, "out_of_range"),  # the close may have replaced the opening, or not
            (None, 0.085, "not_ready"),
            (None, None, ""),
            ((0.08, 0.08), None, ""),
        )
    ),
    # close only narrows: a width is at most the narrowest that they may be
    *(
        (*closes(wanted_m, seen), refused)
        for seen, wanted_m, refused in (
            (situation(), 0.05, ""),
            (situation(), 0.0501, "out_of_range"),
            (situation(moving=True, goals_m=(0.02, 0.02)), 0.021, "out_of_range"),
            (situation(moving=True, goals_m=(0.08, 0.08)), 0.05, ""),
            (situation(goals_m=(0.02, 0.08)), 0.021, "out_of_range"),
            (situation(moving=True, goals_m=None), 0.01, "not_ready"),
            (situation(HELD, closed_to_m=0.02), 0.021, "out_of_range"),
            (situation(HELD, closed_to_m=0.02), 0.02, ""),
            (situation(HELD, closed_to_m=None), 0.01, "not_ready"),
            (situation(closed_to_m=0.02), 0.05, ""),
        )
    ),
    *(
        (*closes(None, seen, None), Permit("move", 0.0, None, 6.0))
        for seen in (situation(), situation(moving=True), situation(HELD, closed_to_m=None))
    ),
]  # fmt: skip
"""What is asked, the situation, and the refusal; "": it is permitted, None: nothing has to be sent."""


@pytest.mark.parametrize(("asked", "seen", "expected"), CASES)
def test_A3_A6_F1_every_rule_by_itself(asked: Intent, seen: Situation, expected: str | Permit | None) -> None:
    found = judge(asked, seen)
    if not isinstance(expected, str):
        assert found == expected
        return
    assert code(found) == expected
    assert isinstance(found, Refusal if expected else Permit)


@pytest.mark.parametrize("kind", KINDS)
def test_a_motion_that_breaks_no_rule_is_permitted(kind: IntentKind) -> None:
    found = judge(of(kind), situation(HELD, moving=True, goals_m=(0.0, 0.0), stops_at_lease_end=True))
    assert (type(found), found.kind) == (Permit, MOVES.get(kind, "halt"))


@pytest.mark.parametrize("refused", ["no_limit", "fault_latched", "no_gripper", "activating", "not_active"])
def test_a_session_that_takes_nothing_is_explained(refused: str) -> None:
    assert why_not_sent(UNREADY[refused]).code == refused
    assert why_not_sent(situation(HELD)).code == "not_active"


@pytest.mark.parametrize(
    ("asked", "seen", "field", "message"),
    [
        (intent("open"), situation(not_free=("left",)), "drop", "fingers must be free, but left may be pressed"),
        (forces("adjust", 25.1), situation(HELD), "delta_n", "from 3 to 25 N"),
        (forces("set", 25.1), situation(HELD), "force_n", "from 3 to 25 N"),
        (forces("reflex", 25.1), situation(HELD), "", "from 3 to 25 N"),
        (closes(0.06, situation())[0], situation(), "width_m", "gripper.close only narrows: "),
        (forces("set", 5.0, None), situation(replace(FREE, unknown=True)), "", "put the object down, then open"),
        (forces("set", 6.0, None), LET_GO, "", "no grip is in force"),
        (forces("set", 9.0), situation(HELD), "force_n", "at most 2 N from the 6 N in force, got 9 N$"),
        (
            replace(forces("set", 9.0), force_applied_n=8.75), situation(HELD), "force_n",
            "in force, got 9 N, for which the gripper's setting is 8.75 N$",
        ),
        (forces("set", 6.5), BLIND, "force_n", "stale or not trusted: right"),
        (forces("reflex", 6.5), BLIND, "", "stale or not trusted: right"),
        (
            forces("reflex", 7.9, 9.0), situation(replace(HELD, force_n=9.0, requested_n=8.0)), "",
            "must not lower below the requested 8 N$",
        ),
        (
            opens(0.0, 0.0412), situation(), "width_m",
            "gripper.open only widens: width_m must be at least the present 0.0412 m, got 0; "
            "use gripper.close to close",
        ),
    ],
)  # fmt: skip
def test_a_refusal_says_what_to_do(asked: Intent, seen: Situation, field: str, message: str) -> None:
    found = judge(asked, seen)
    assert found.field == field
    assert re.search(message, found.message)


@pytest.mark.parametrize(("width_m", "shown"), [(0.04123, "0.0413"), (0.0412, "0.0412"), (11 / 255, "0.0432")])
def test_the_width_that_is_named_is_accepted(width_m: float, shown: str) -> None:
    assert f"the present {shown} m" in judge(opens(0.0, width_m), situation()).message
    assert isinstance(judge(opens(float(shown), width_m), situation()), Permit)


@cache
def calls() -> list[tuple[str, str]]:
    """Return file and callee of every call in the daemon, such as ``session.execute``."""
    return [
        (path.relative_to(DAEMON).as_posix(), ast.unparse(node.func))
        for path in DAEMON.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
    ]


def callers(function: str) -> set[str]:
    """Return the files of the daemon that call a function, class or method."""
    return {path for path, called in calls() if called.endswith(function)}


@pytest.mark.uncovered
def test_only_the_gate_issues_permits_and_only_the_gripper_control_hands_them_to_a_session() -> None:
    assert callers("Permit") == {"gripper/grip_gate.py"}
    assert callers("session.execute") == {"gripper/gripper_control.py"}
    assert not any(callers(f"session.{method}") for method in ("activate", "move", "set_force", "halt"))


def test_a_rig_without_a_gripper_has_a_lease_and_nothing_to_report() -> None:
    gripper = NoGripper()
    assert not gripper.on_time(0)
    gripper.policy.lease.acquire(b"ann", 200, 0)
    assert gripper.deadline_ns == 200_000_000
    gripper.wake()
    assert gripper.on_time(1) is True
