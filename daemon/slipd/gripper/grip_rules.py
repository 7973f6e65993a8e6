"""The rules of the grip gate: each returns why an intent may not be carried out, or None.

Which kinds of intent a rule binds, and in which order rules are checked, is in `slipd.gripper.grip_gate.TABLE`.
"""

from __future__ import annotations

import math

from slipd.gripper.grip_policy import ROUNDING_N
from slipd.gripper.intent import Intent, Situation
from slipd.gripper.lease import NO_LEASE
from slipd.types.permit import Refusal

ACTIVATING = Refusal("activating", "the gripper is still activating")
NOT_ACTIVE = Refusal("not_active", "request gripper.activate first; it moves the fingers fully")
_NO_LIMIT = Refusal("no_limit", "gripper.max_force_n is not configured, so nothing may be moved")
_NO_ANSWER = Refusal("no_gripper", "the gripper does not answer; see status.streams.gripper")
_NOTHING_GRIPPED = Refusal("not_ready", "no grip is in force: gripper.close begins one")

PUT_DOWN = "put the object down, then open (gripper.open with drop: true)"
"""What a client can do about a grip of unknown force."""

_SHOWN_M = 1e-4
"""Error texts round widths to this, m, towards what would be accepted."""

_SHOWN_ROUNDING = 1e-6
"""Fraction of `_SHOWN_M` within which a width counts as exact."""


# -- the client, and whether the gripper can move at all


def client_holds_the_lease(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse a client that does not hold the lease."""
    return None if intent.who is not None and intent.who == situation.grip.holder else NO_LEASE


def limit_is_configured(_: Intent, situation: Situation) -> Refusal | None:
    """Refuse to move anything without a configured force limit."""
    return _NO_LIMIT if situation.limits.max_n is None else None


def no_fault_is_latched(_: Intent, situation: Situation) -> Refusal | None:
    """Refuse to move while a fault is latched."""
    fault = situation.grip.fault
    return (
        Refusal("fault_latched", f"{fault} is latched: look at the gripper, then: slipctl grip ack (fault.ack)")
        if fault
        else None
    )


def gripper_answers(_: Intent, situation: Situation) -> Refusal | None:
    """Refuse to move a gripper that does not answer."""
    return None if situation.gripper.answers else _NO_ANSWER


def gripper_has_no_fault(_: Intent, situation: Situation) -> Refusal | None:
    """Refuse to move a gripper that reports a fault."""
    fault = situation.gripper.fault
    return Refusal("gripper_fault", f"the gripper reports {fault}") if fault else None


def gripper_is_active(_: Intent, situation: Situation) -> Refusal | None:
    """Refuse to move a gripper that is not active, or not yet."""
    if situation.gripper.activating:
        return ACTIVATING
    return None if situation.gripper.active else NOT_ACTIVE


# -- what may fall


def fingers_are_free_or_may_drop(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse to open while an object is held or may be, unless the client accepts that it falls."""
    if intent.drop or not situation.not_free:
        return None
    names = ", ".join(situation.not_free)
    pressed = f"fingers must be free, but {names} may be pressed (slipctl status says why)"
    return Refusal("in_contact", f"{pressed}; drop: true opens anyway", "drop")


# -- forces


def force_is_within_limits(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse a force that is not finite, or outside the configured limits."""
    wanted_n, limits = intent.force_wanted_n, situation.limits
    if wanted_n is None:
        return None
    if not math.isfinite(wanted_n):
        return _force("not_finite", f"must be finite, got {wanted_n}", intent)
    if limits.max_n is None or not limits.min_n <= wanted_n <= limits.max_n:
        allowed = f"must be from {limits.min_n:g} to {limits.max_n or 0.0:g} N on one pad"
        return _force("out_of_range", f"{allowed}, got {wanted_n:g}", intent)
    return None


def gripper_has_the_force(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse a force that the gripper does not have, or whose setting falls below the least."""
    wanted_n, applied_n = intent.force_wanted_n, intent.force_applied_n
    least_n, most_n = situation.gripper.force_range_n
    if wanted_n is None or applied_n is None:
        return None
    if not least_n <= wanted_n <= most_n:
        allowed = f"must be from {least_n:g} to {most_n:g} N on one pad for this gripper"
        return _force("out_of_range", f"{allowed}, got {wanted_n:g}", intent)
    if applied_n < situation.limits.min_n:
        steps = f"is too low: the gripper's next setting down is {applied_n:g} N"
        return _force("out_of_range", f"{steps}, below min_force_n, {situation.limits.min_n:g} N", intent)
    return None


def force_in_force_is_known(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse any force while an unknown one holds an object: it could rise or fall by any amount."""
    if not situation.grip.unknown or (situation.grip.releasing and intent.kind != "close"):
        return None
    return Refusal("not_ready", f"the force of the grip in force is not known, and stays as it is: {PUT_DOWN}")


def grip_is_in_force(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse to change the force of a grip if none is in force."""
    return _NOTHING_GRIPPED if intent.force_in_force_n is None else None


def change_is_within_a_step(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse a change of the force in force by more than a step."""
    step_n, change_n = situation.limits.step_n, _change_n(intent)
    if abs(change_n) <= step_n + ROUNDING_N:
        return None
    allowed = f"may change by at most {step_n:g} N from the {intent.force_in_force_n:g} N in force"
    got = f"got {intent.force_wanted_n:g} N"
    if intent.force_applied_n != intent.force_wanted_n:
        got += f", for which the gripper's setting is {intent.force_applied_n:g} N"
    return _force("out_of_range", f"{allowed}, {got}", intent)


def change_is_within_a_step_of_what_acts(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse a force more than a step from the one that the gripper acknowledged last.

    Commands that the gripper has not acknowledged may be lost. The next one would then act with them, all at once.
    """
    acts_n, applied_n, step_n = situation.gripper.force_acknowledged_n, intent.force_applied_n, situation.limits.step_n
    if acts_n is None or applied_n is None or intent.force_in_force_n is None:
        return None
    if abs(applied_n - acts_n) <= step_n + ROUNDING_N:
        return None
    allowed = f"must be within {step_n:g} N of the {acts_n:g} N that the gripper acknowledged last"
    return _force("too_fast", f"{allowed}, got {applied_n:g} N: ask again when it has acknowledged the rest", intent)


def raises_stay_within_the_budget(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse a raise beyond what is left of the budget of this grasp; the reflex has one of its own."""
    left_n = situation.grip.reflex_left_n if intent.kind == "reflex" else situation.grip.budget_left_n
    raise_n = _change_n(intent)
    if raise_n <= 0.0 or raise_n <= left_n + ROUNDING_N:
        return None
    budget = f"raise must be at most {left_n:g} N, the rest of the {situation.limits.budget_n:g} N budget of this grasp"
    return Refusal("budget_spent", f"{budget}, got {raise_n:g} N", _force_field(intent))


def change_is_slow_enough(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse a change that exceeds the slew rate."""
    limits, change_n = situation.limits, _change_n(intent)
    raises = change_n > 0.0
    left_n = situation.grip.raise_left_n if raises else situation.grip.lower_left_n
    missing_n = min(abs(change_n), limits.step_n) - left_n
    if missing_n <= ROUNDING_N:
        return None
    rate = limits.raise_n_per_s if raises else limits.lower_n_per_s
    wait_ms = math.ceil(missing_n / rate * 1e3)
    return _force("too_fast", f"may change at most {rate:g} N/s: ask again in {wait_ms} ms", intent)


def raise_needs_trusted_sensors(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse a raise while a sensor is stale or not trusted."""
    if _change_n(intent) <= 0.0 or not situation.blind:
        return None
    names = ", ".join(situation.blind)
    return _force(
        "not_ready", f"must not be raised while sensors are stale or not trusted: {names}; see status", intent
    )


def reflex_needs_trusted_sensors(_: Intent, situation: Situation) -> Refusal | None:
    """Refuse every act of the reflex while a sensor is stale or not trusted."""
    return Refusal("not_ready", f"stale or not trusted: {', '.join(situation.blind)}") if situation.blind else None


def reflex_keeps_the_requested_force(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse to let the reflex lower below the force that a client requested."""
    requested_n = situation.grip.requested_n
    if requested_n is None or _change_n(intent) >= 0.0 or (intent.force_applied_n or 0.0) >= requested_n - ROUNDING_N:
        return None
    return Refusal("out_of_range", f"the reflex must not lower below the requested {requested_n:g} N")


# -- widths and speeds


def gripper_has_the_width(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse a width that the gripper does not have."""
    width_m, (least_m, most_m) = intent.width_wanted_m, situation.gripper.width_range_m
    if width_m is None or least_m <= width_m <= most_m:
        return None
    return _width("out_of_range", f"must be from {least_m:g} to {most_m:g} m, got {width_m:g}")


def gripper_has_the_speed(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse a speed that the gripper does not have."""
    speed_mps, speeds = intent.speed_mps, situation.gripper.speed_range_mps
    if speed_mps is None:
        return None
    if speeds is None:
        return Refusal("out_of_range", "speed_mps must be left out: this gripper accepts no speed", "speed_mps")
    if speeds[0] <= speed_mps <= speeds[1]:
        return None
    allowed = f"speed_mps must be from {speeds[0]:g} to {speeds[1]:g} m/s"
    return Refusal("out_of_range", f"{allowed}, got {speed_mps:g}", "speed_mps")


def open_width_is_known(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse to open fully if the gripper's largest width is not known."""
    if intent.width_wanted_m is not None or math.isfinite(situation.gripper.width_range_m[1]):
        return None
    return _width("not_ready", "is needed: the gripper has not reported its widths yet")


def least_force_is_allowed(_: Intent, situation: Situation) -> Refusal | None:
    """Refuse to open if even the least force of the gripper is above the limit."""
    most_n = situation.limits.max_n or 0.0
    if situation.least_n <= most_n:
        return None
    return Refusal(
        "out_of_range",
        f"the gripper's least force must be at most max_force_n, {most_n:g} N, got {situation.least_n:g} N",
    )


def present_width_is_known(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse a width if there is no known width to compare it with."""
    gripper = situation.gripper
    if intent.width_wanted_m is None:
        return None
    if intent.width_now_m is None:
        return _width("not_ready", "must be left out: the present width is not known")
    if gripper.moving and gripper.goals_m is None:
        return _width("not_ready", "must be left out: the fingers move to an unknown goal")
    if intent.kind == "close" and situation.grip.grips and gripper.closed_to_m is None:
        return _width("not_ready", "must be left out: the commanded width of the grip in force is not known")
    return None


def open_only_widens(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse to narrow. Moving fingers may already be as wide as their goal; fully open is always allowed."""
    gripper, wanted_m = situation.gripper, intent.width_wanted_m
    if wanted_m is None:
        return None
    widest_m = max((intent.width_now_m or 0.0, *(gripper.goals_m or ())))
    least_m = min(widest_m, gripper.width_range_m[1])
    if wanted_m >= least_m:
        return None
    least = f"the present {math.ceil(least_m / _SHOWN_M - _SHOWN_ROUNDING) * _SHOWN_M:.4f} m"
    rule = f"must be at least {least}, got {wanted_m:g}; use gripper.close to close"
    return _width("out_of_range", rule, "gripper.open only widens: ")


def close_only_narrows(intent: Intent, situation: Situation) -> Refusal | None:
    """Refuse to widen.

    Moving fingers may already be as narrow as their goal. A grip in force presses towards its commanded width, so a
    wider goal would open it or take its force away.
    """
    gripper, wanted_m = situation.gripper, intent.width_wanted_m
    if wanted_m is None:
        return None
    closed_to_m = gripper.closed_to_m if situation.grip.grips else None
    widths_m = intent.width_now_m, *(gripper.goals_m or ()), closed_to_m
    most_m = min((width_m for width_m in widths_m if width_m is not None), default=math.inf)
    if wanted_m <= most_m:
        return None
    most = f"{math.floor(most_m / _SHOWN_M + _SHOWN_ROUNDING) * _SHOWN_M:.4f} m"
    rule = f"must be at most {most}, got {wanted_m:g}; use gripper.open to open"
    return _width("out_of_range", rule, "gripper.close only narrows: ")


def _change_n(intent: Intent) -> float:
    """Return the change of the force in force, N; 0 if none is in force or requested."""
    if intent.force_in_force_n is None or intent.force_applied_n is None:
        return 0.0
    return intent.force_applied_n - intent.force_in_force_n


def _force_field(intent: Intent) -> str:
    return {"adjust": "delta_n", "reflex": ""}.get(intent.kind, "force_n")


def _force(code: str, rule: str, intent: Intent) -> Refusal:
    return Refusal(code, f"force_n {rule}", _force_field(intent))


def _width(code: str, rule: str, opening: str = "") -> Refusal:
    return Refusal(code, f"{opening}width_m {rule}", "width_m")
