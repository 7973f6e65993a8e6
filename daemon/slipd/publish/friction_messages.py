"""Friction of one finger, as several messages and replies state it."""

from __future__ import annotations

from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.friction.friction_state import FrictionState
from slipd.publish.wire_values import Body
from slipd.types.finite import finite_or_none


def friction_body(friction: FrictionState) -> Body:
    """Return the friction of one finger, its source and its interval."""
    return {
        "mu": friction.mu,
        "mu_source": friction.source,
        "mu_low": friction.mu_low,
        "mu_high": friction.mu_high,
        "mu_d": friction.mu_d,
    }


def friction_setter_body(finger: Finger) -> Body:
    """Return the friction in use of one finger, and which client set it."""
    friction = finger.friction
    return {**friction_body(friction.state), "mu_by": friction.set_by, "mu_t_ns": friction.set_t_ns}


def required_friction_body(state: FingerState) -> Body:
    """Return what friction the load requires, beside what this grasp has carried."""
    q = finite_or_none(state.required_friction)
    carried = None if state.friction is None else state.friction.carried
    return {
        "required_friction": q,
        "carried_friction": carried,
        "relative_utilisation": None if q is None or carried is None else q / carried,
    }
