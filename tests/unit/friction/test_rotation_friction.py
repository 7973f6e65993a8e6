"""Friction against rotation, as the turns of one grasp teach it."""

from __future__ import annotations

import pytest

from slipd.friction.friction_state import LEAST_SHARE, ONSET_S, FrictionState, RotationFriction

STATED = 0.08
REPORTED_S = 0.3


def turn(rotation: RotationFriction, t_s: float, required: float) -> None:
    """Turn the object at a spin that has just sunk to half."""
    rotation.carry(t_s - 0.1, required)
    rotation.carry(t_s, 0.5 * required)
    rotation.slip(t_s + REPORTED_S)


@pytest.mark.parametrize(
    ("turns", "learned"),
    [
        ([], None),
        ([(1.0, 0.06)], 0.06),
        ([(1.0, 0.06), (1.2, 0.07), (1.4, 0.05)], 0.07),  # a turn that goes on is one sample
        ([(1.0, 0.10), (5.0, 0.05)], (0.05 * 0.10**0.6) ** (1 / 1.6)),  # the newest weighs most
        ([(1.0, 0.99 * LEAST_SHARE * STATED)], None),  # a slip with little spin is a translation
        ([(1.0, 0.99 * LEAST_SHARE * STATED), (1.2, 0.06)], 0.06),
    ],
)
def test_the_largest_spin_before_a_turn_was_the_limit(turns: list[tuple[float, float]], learned: float | None) -> None:
    rotation, calibrated = RotationFriction(STATED), RotationFriction(None)
    for each in (rotation, calibrated):
        each.slip(0.1)
        each.carry(1.0 - ONSET_S - 0.11, 0.2)  # too long before
        for t_s, required in turns:
            turn(each, t_s, required)
    assert rotation.learned == (None if learned is None else pytest.approx(learned))
    assert calibrated.learned is None, "calibrated taxels learn nothing here"
    rotation.forget()
    rotation.slip(9.0)
    assert rotation.learned is None, "the grasp ended"


def test_a_spin_uses_more_friction_than_mu_says_and_never_less() -> None:
    assert FrictionState(0.32).spin_scale == 1.0
    assert FrictionState(None, mu_rotation=0.08).spin_scale == 1.0
    assert FrictionState(0.32, mu_rotation=0.08).spin_scale == pytest.approx(4.0)
    assert FrictionState(0.32, mu_rotation=0.40).spin_scale == 1.0
