"""The only place that decides whether a motion may happen. docs/grip_rules.md is the table in words.

Every way in which fingers can move or a force can change is an `Intent`. `judge` checks it against `TABLE` in a given
situation and returns the refusal of the first rule that it breaks, or a permit. Gripper sessions carry out permits, and
only this module issues them.
"""

from __future__ import annotations

from collections.abc import Callable

from slipd.gripper import grip_rules as rules
from slipd.gripper.intent import Intent, IntentKind, Situation
from slipd.types.permit import Permit, Refusal

Rule = Callable[[Intent, Situation], Refusal | None]

KINDS: tuple[IntentKind, ...] = ("activate", "open", "close", "set", "adjust", "reflex", "hold", "stop", "lease_end")


def _rows(*rows: tuple[Rule, str]) -> tuple[tuple[Rule, frozenset[IntentKind]], ...]:
    marked = [(rule, zip(KINDS, marks.split(), strict=True)) for rule, marks in rows]
    return tuple((rule, frozenset(kind for kind, mark in marks if mark == "x")) for rule, marks in marked)


# fmt: off
TABLE = _rows(
    # rule                                      activate open close set adjust reflex hold stop lease_end
    (rules.client_holds_the_lease,             "x        x    x     x   x      .      x    x    ."),
    (rules.limit_is_configured,                "x        x    x     x   x      x      .    .    ."),
    (rules.no_fault_is_latched,                "x        x    x     x   x      x      .    .    ."),
    (rules.gripper_answers,                    "x        x    x     x   x      x      .    .    ."),
    (rules.gripper_has_no_fault,               ".        x    x     x   x      x      .    .    ."),
    (rules.gripper_is_active,                  ".        x    x     x   x      x      .    .    ."),
    (rules.fingers_are_free_or_may_drop,       "x        x    .     .   .      .      .    .    ."),
    (rules.force_is_within_limits,             ".        .    x     x   x      x      .    .    ."),
    (rules.gripper_has_the_force,              ".        .    x     x   x      x      .    .    ."),
    (rules.force_in_force_is_known,            ".        .    x     x   x      x      .    .    ."),
    (rules.grip_is_in_force,                   ".        .    .     x   x      x      .    .    ."),
    (rules.change_is_within_a_step,            ".        .    x     x   x      x      .    .    ."),
    (rules.raises_stay_within_the_budget,      ".        .    x     x   x      x      .    .    ."),
    (rules.change_is_slow_enough,              ".        .    x     x   x      x      .    .    ."),
    (rules.change_is_within_a_step_of_what_acts, ".       .    x     x   x      x      .    .    ."),
    (rules.raise_needs_trusted_sensors,        ".        .    x     x   x      .      .    .    ."),
    (rules.reflex_needs_trusted_sensors,       ".        .    .     .   .      x      .    .    ."),
    (rules.reflex_keeps_the_requested_force,   ".        .    .     .   .      x      .    .    ."),
    (rules.gripper_has_the_width,              ".        x    x     .   .      .      .    .    ."),
    (rules.gripper_has_the_speed,              ".        x    x     .   .      .      .    .    ."),
    (rules.open_width_is_known,                ".        x    .     .   .      .      .    .    ."),
    (rules.least_force_is_allowed,             ".        x    .     .   .      .      .    .    ."),
    (rules.present_width_is_known,             ".        x    x     .   .      .      .    .    ."),
    (rules.open_only_widens,                   ".        x    .     .   .      .      .    .    ."),
    (rules.close_only_narrows,                 ".        .    x     .   .      .      .    .    ."),
)
"""The decision table: rules in the order in which they are checked, and the kinds of intent that each binds."""
# fmt: on


def judge(intent: Intent, situation: Situation) -> Refusal | Permit | None:
    """Judge an intent against every rule in `TABLE` that binds its kind.

    Returns:
        The refusal of the first rule that it breaks, or a permit; None if it is allowed and nothing has to be sent.
    """
    for rule, kinds in TABLE:
        if intent.kind in kinds and (refusal := rule(intent, situation)) is not None:
            return refusal
    return _permit(intent, situation)


def why_not_sent(situation: Situation) -> Refusal:
    """Return why a session sent nothing for a permit: the gripper cannot receive commands."""
    for rule in (rules.limit_is_configured, rules.no_fault_is_latched, rules.gripper_answers):
        if (refusal := rule(Intent("stop"), situation)) is not None:
            return refusal
    return rules.ACTIVATING if situation.gripper.activating else rules.NOT_ACTIVE


def _permit(intent: Intent, situation: Situation) -> Permit | None:
    gripper = situation.gripper
    match intent.kind:
        case "activate":
            return Permit("activate")
        case "open" | "close":
            opens = intent.kind == "open"
            goal_m = gripper.width_range_m[opens] if intent.width_wanted_m is None else intent.width_wanted_m
            return Permit("move", goal_m, intent.speed_mps, situation.least_n if opens else intent.force_wanted_n)
        case "set" | "adjust" | "reflex":
            return Permit("set_force", force_n=intent.force_wanted_n)
        case "stop":
            return Permit("halt")
        case "hold":
            return Permit("halt") if gripper.moving or not gripper.active else None
        case "lease_end":  # pragma: no branch - the last kind; mypy reports one that is missing
            return Permit("halt") if gripper.moving and gripper.stops_at_lease_end else None
