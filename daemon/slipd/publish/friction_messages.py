"""Friction of one finger, as several messages and replies state it."""

from __future__ import annotations

from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.finite import finite_or_none
from slipd.publish.wire_values import Body


def friction_body(finger: Finger) -> Body:
    """Return the friction in use of one finger, its source and its interval."""
    friction = finger.friction
    return {
        "mu": friction.mu,
        "mu_source": friction.source or "none",
        "mu_low": None,
        "mu_high": None,
        "mu_d": None,
    }


def friction_setter_body(finger: Finger) -> Body:
    """Return the friction in use of one finger, and which client set it."""
    friction = finger.friction
    return {**friction_body(finger), "mu_by": friction.set_by, "mu_t_ns": friction.set_t_ns}


def required_friction_body(state: FingerState) -> Body:
    """Return what friction the load requires, beside what this grasp has carried."""
    return {
        "required_friction": finite_or_none(state.required_friction),
        "carried_friction": None,
        "relative_utilisation": None,
    }
