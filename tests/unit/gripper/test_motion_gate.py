"""One table of rules decides on every motion: each rule by itself, and no motion bypasses the gate."""

from __future__ import annotations

import ast
import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from judging import READY

import slipd
from slipd.gripper.grip_policy import GripLimits, GripState
from slipd.gripper.intent import Intent, IntentKind, Situation
from slipd.gripper.motion_gate import KINDS, TABLE, judge, why_not_sent
from slipd.gripper.no_gripper import NoGripper
from slipd.types.permit import Permit
from slipd.types.refusal import Refusal

LIMITS = GripLimits(min_n=3.0, max_n=25.0, step_n=2.0, raise_n_per_s=10.0, lower_n_per_s=2.0, budget_n=12.0)
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


def test_every_rule_binds_some_kind_and_every_row_names_known_kinds() -> None:
    assert all(kinds and kinds <= set(KINDS) for _, kinds in TABLE)
    assert len({rule for rule, _ in TABLE}) == len(TABLE)


@pytest.mark.parametrize("kind", KINDS)
def test_a_motion_that_breaks_no_rule_is_permitted(kind: IntentKind) -> None:
    found = judge(of(kind), situation(HELD, moving=True, goals_m=(0.0, 0.0), stops_at_lease_end=True))
    wanted = {"activate": "activate", "open": "move", "close": "move"} | dict.fromkeys(FORCING[1:], "set_force")
    assert isinstance(found, Permit)
    assert found.kind == wanted.get(kind, "halt")


@pytest.mark.parametrize("kind", KINDS)
def test_a_client_must_hold_the_lease(kind: IntentKind) -> None:
    for holder in (b"ben", None):
        found = judge(of(kind), situation(replace(HELD, holder=holder), moving=True, goals_m=(0.0, 0.0)))
        assert code(found) == ("" if kind in ("reflex", "lease_end") else "no_lease")
    assert code(judge(replace(of(kind), who=None), situation(replace(HELD, holder=None)))) == (
        "" if kind in ("reflex", "lease_end") else "no_lease"
    )


@pytest.mark.parametrize("kind", MOVING)
@pytest.mark.parametrize(
    ("refused", "seen"),
    [
        ("no_limit", situation(HELD, replace(LIMITS, max_n=None))),
        ("fault_latched", situation(replace(HELD, fault="E-stop"))),
        ("no_gripper", situation(HELD, answers=False, active=False)),
        ("gripper_fault", situation(HELD, fault="overcurrent")),
        ("not_active", situation(HELD, active=False)),
        ("activating", situation(HELD, active=False, activating=True)),
    ],
)
def test_a_gripper_that_is_not_ready_is_not_moved(kind: IntentKind, refused: str, seen: Situation) -> None:
    allowed = kind == "activate" and refused in ("gripper_fault", "not_active", "activating")
    assert code(judge(of(kind), seen)) == ("" if allowed else refused)


@pytest.mark.parametrize("kind", FORCING)
@pytest.mark.parametrize(
    ("acknowledged_n", "refused"), [(None, ""), (5.0, ""), (9.0, ""), (4.9, "too_fast"), (9.1, "too_fast")]
)
def test_A6_a_force_is_within_a_step_of_the_one_that_the_gripper_acknowledged(
    kind: IntentKind, acknowledged_n: float | None, refused: str
) -> None:
    assert code(judge(of(kind), situation(HELD, force_acknowledged_n=acknowledged_n))) == refused
    begins = replace(of("close"), force_in_force_n=None)
    assert code(judge(begins, situation(force_acknowledged_n=acknowledged_n))) == ""


@pytest.mark.parametrize("kind", ["hold", "stop", "lease_end"])
def test_stopping_is_never_refused_for_what_is_wrong(kind: IntentKind) -> None:
    limits, grip = replace(LIMITS, max_n=None), replace(HELD, fault="E-stop")
    seen = situation(grip, limits, answers=False, active=False, fault="internal", moving=True, stops_at_lease_end=True)
    assert judge(of(kind), seen) == Permit("halt")


def test_nothing_is_sent_where_nothing_moves() -> None:
    assert judge(of("hold"), situation(HELD)) is None
    assert judge(of("lease_end"), situation(HELD, stops_at_lease_end=True)) is None
    assert judge(of("lease_end"), situation(HELD, moving=True, goals_m=(0.0, 0.0))) is None, (
        "the config does not want it"
    )
    assert judge(of("stop"), situation(HELD)) == Permit("halt")


@pytest.mark.parametrize(
    ("refused", "seen"),
    [
        ("no_limit", situation(HELD, replace(LIMITS, max_n=None))),
        ("fault_latched", situation(replace(HELD, fault="E-stop"))),
        ("no_gripper", situation(HELD, answers=False, active=False)),
        ("activating", situation(HELD, activating=True)),
        ("not_active", situation(HELD)),
    ],
)
def test_a_session_that_takes_nothing_is_explained(refused: str, seen: Situation) -> None:
    assert why_not_sent(seen).code == refused


@pytest.mark.parametrize("kind", ["open", "activate"])
def test_what_may_fall_is_let_go_only_for_who_accepts_it(kind: IntentKind) -> None:
    seen = situation(not_free=("left",))
    found = judge(intent(kind), seen)
    assert isinstance(found, Refusal)
    assert (found.code, found.field) == ("in_contact", "drop")
    assert "left" in found.message
    assert isinstance(judge(intent(kind, drop=True), seen), Permit)


@pytest.mark.parametrize("kind", FORCING)
@pytest.mark.parametrize("force_n", [2.9, 25.1, -1.0, math.nan, math.inf])
def test_a_force_outside_the_limits_is_refused(kind: IntentKind, force_n: float) -> None:
    applied_n = force_n if math.isfinite(force_n) else None
    found = judge(
        intent(kind, force_wanted_n=force_n, force_applied_n=applied_n, force_in_force_n=6.0), situation(HELD)
    )
    assert isinstance(found, Refusal)
    assert found.code == ("out_of_range" if math.isfinite(force_n) else "not_finite")
    assert found.field == {"adjust": "delta_n", "reflex": ""}.get(kind, "force_n")


def test_a_raise_on_a_blind_finger_is_refused_and_lowering_is_not() -> None:
    seen = situation(HELD, blind=("right",))
    for kind in FORCING:
        raised = judge(intent(kind, force_in_force_n=6.0, force_wanted_n=6.5), seen)
        assert code(raised) == "not_ready"
        lowered = judge(intent(kind, force_in_force_n=6.0, force_wanted_n=5.5), seen)
        assert code(lowered) == ("not_ready" if kind == "reflex" else ""), "the reflex does nothing it cannot feel"
    assert isinstance(judge(intent("close", force_wanted_n=20.0), situation(blind=("right",))), Permit)


@pytest.mark.parametrize(("now_n", "wanted_n", "refused"), [(6.0, 6.5, False), (9.0, 8.0, False), (9.0, 7.9, True)])
def test_the_reflex_lowers_no_further_than_requested_and_may_raise_below_it(
    now_n: float, wanted_n: float, refused: bool
) -> None:
    found = judge(
        intent("reflex", force_in_force_n=now_n, force_wanted_n=wanted_n),
        situation(replace(HELD, force_n=now_n, requested_n=8.0)),
    )
    assert (code(found) == "out_of_range") is refused


@pytest.mark.parametrize("kind", FORCING)
@pytest.mark.parametrize("force_n", [3.0, 6.0, 25.0])
def test_an_unknown_force_is_neither_raised_nor_lowered(kind: IntentKind, force_n: float) -> None:
    found = judge(intent(kind, force_wanted_n=force_n), situation(replace(FREE, unknown=True)))
    assert isinstance(found, Refusal)
    assert found.code == "not_ready"
    assert "put the object down, then open" in found.message


def test_a_grip_that_is_being_let_go_counts_for_a_close_alone() -> None:
    seen = situation(replace(HELD, releasing=True, unknown=True))
    assert code(judge(intent("close", force_in_force_n=3.0, force_wanted_n=25.0), seen)) != ""
    for kind in FORCING[1:]:
        found = judge(intent(kind, force_wanted_n=6.0), seen)
        assert isinstance(found, Refusal)
        assert "no grip is in force" in found.message


class TestOpenOnlyWidens:
    def test_what_the_fault_was_is_refused_with_what_to_do(self) -> None:
        found = judge(intent("open", width_now_m=0.0412, width_wanted_m=0.0), situation())
        assert found == Refusal(
            "out_of_range",
            "gripper.open only widens: width_m must be at least the present 0.0412 m, got 0; "
            "use gripper.close to close",
            "width_m",
        )

    @pytest.mark.parametrize(("width_m", "shown"), [(0.04123, "0.0413"), (0.0412, "0.0412"), (11 / 255, "0.0432")])
    def test_the_width_that_is_named_is_accepted(self, width_m: float, shown: str) -> None:
        found = judge(intent("open", width_now_m=width_m, width_wanted_m=0.0), situation())
        assert isinstance(found, Refusal)
        assert f"the present {shown} m" in found.message
        again = judge(intent("open", width_now_m=width_m, width_wanted_m=float(shown)), situation())
        assert isinstance(again, Permit)

    @pytest.mark.parametrize("drop", [True, False])
    def test_drop_does_not_make_it_a_close(self, drop: bool) -> None:
        found = judge(intent("open", width_wanted_m=0.0499, drop=drop), situation(not_free=("left",) if drop else ()))
        assert code(found) == "out_of_range"

    def test_the_present_width_may_be_asked_for(self) -> None:
        assert judge(intent("open", width_wanted_m=0.05), situation()) == Permit("move", 0.05, None, 3.0)

    def test_fully_open_is_allowed_from_wherever_the_fingers_are(self) -> None:
        for now_m in (None, 0.0, 0.0855):
            assert judge(intent("open", width_now_m=now_m), situation()) == Permit("move", 0.085, None, 3.0)
        assert isinstance(judge(intent("open", width_now_m=0.0855, width_wanted_m=0.085), situation()), Permit)

    def test_a_width_is_refused_where_the_present_one_is_not_known(self) -> None:
        assert code(judge(intent("open", width_now_m=None, width_wanted_m=0.08), situation())) == "not_ready"

    @pytest.mark.parametrize(
        ("goals_m", "wanted_m", "refused"),
        [
            ((0.08, 0.08), 0.07, "out_of_range"),  # they may be there already
            ((0.08, 0.08), 0.08, ""),
            ((0.02, 0.02), 0.049, "out_of_range"),  # they close, and may have got no further than this
            ((0.02, 0.02), 0.05, ""),
            ((0.02, 0.08), 0.07, "out_of_range"),  # the close may have replaced the opening, or not
            (None, 0.085, "not_ready"),
        ],
    )
    def test_of_moving_fingers_the_widest_they_may_be_counts(
        self, goals_m: tuple[float, float] | None, wanted_m: float, refused: str
    ) -> None:
        seen = situation(moving=True, goals_m=goals_m)
        assert code(judge(intent("open", width_wanted_m=wanted_m), seen)) == refused
        assert isinstance(judge(intent("open"), seen), Permit)


class TestCloseOnlyNarrows:
    @pytest.mark.parametrize(
        ("seen", "wanted_m", "refused"),
        [
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
        ],
    )
    def test_a_width_is_compared_with_the_narrowest_that_they_may_be(
        self, seen: Situation, wanted_m: float, refused: str
    ) -> None:
        close = intent("close", width_wanted_m=wanted_m, force_wanted_n=6.0, force_in_force_n=seen.grip.force_n)
        assert code(judge(close, seen)) == refused

    def test_fully_closed_is_allowed_from_wherever_the_fingers_are(self) -> None:
        for seen in (situation(), situation(moving=True), situation(HELD, closed_to_m=None)):
            close = intent("close", width_now_m=None, force_wanted_n=6.0, force_in_force_n=seen.grip.force_n)
            assert judge(close, seen) == Permit("move", 0.0, None, 6.0)


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


def test_only_the_gate_issues_permits() -> None:
    assert callers("Permit") == {"gripper/motion_gate.py"}


def test_only_the_gripper_control_hands_permits_to_a_session() -> None:
    assert callers("session.execute") == {"gripper/gripper_control.py"}


@pytest.mark.parametrize("method", ["activate", "move", "set_force", "halt"])
def test_no_other_method_moves_a_session(method: str) -> None:
    assert callers(f"session.{method}") == set()


def test_a_rig_without_a_gripper_has_nothing_to_report() -> None:
    assert NoGripper().conditions() == []
