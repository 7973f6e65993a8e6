"""Friction against rotation, as the turns of one grasp teach it."""

from __future__ import annotations

import pytest

from slipd.friction.friction_state import FrictionState
from slipd.friction.rotation_friction import LEAST_SHARE, ONSET_S, RotationFriction

STATED = 0.08
REPORTED_S = 0.3


def turn(rotation: RotationFriction, t_s: float, required: float) -> None:
    """Turn the object at a spin that has just sunk to half."""
    rotation.carry(t_s - 0.1, required)
    rotation.carry(t_s, 0.5 * required)
    rotation.slip(t_s + REPORTED_S)


def test_nothing_is_known_before_the_object_turned() -> None:
    rotation = RotationFriction(STATED)
    rotation.slip(1.0)
    rotation.carry(1.0, 0.2)
    assert rotation.learned is None


def test_the_largest_spin_before_a_turn_was_the_limit() -> None:
    rotation = RotationFriction(STATED)
    rotation.carry(1.0 - ONSET_S - 0.11, 0.2)
    turn(rotation, 1.0, 0.06)
    assert rotation.learned == pytest.approx(0.06)


def test_a_turn_that_goes_on_is_one_sample() -> None:
    rotation = RotationFriction(STATED)
    turn(rotation, 1.0, 0.06)
    turn(rotation, 1.2, 0.07)
    assert rotation.learned == pytest.approx(0.07)
    turn(rotation, 1.4, 0.05)
    assert rotation.learned == pytest.approx(0.07)


def test_the_newest_turn_weighs_most() -> None:
    rotation = RotationFriction(STATED)
    turn(rotation, 1.0, 0.10)
    turn(rotation, 5.0, 0.05)
    assert rotation.learned == pytest.approx((0.05 * 0.10**0.6) ** (1 / 1.6))


def test_a_slip_with_little_spin_is_a_translation() -> None:
    rotation = RotationFriction(STATED)
    turn(rotation, 1.0, 0.99 * LEAST_SHARE * STATED)
    assert rotation.learned is None
    turn(rotation, 1.2, 0.06)
    assert rotation.learned == pytest.approx(0.06)


def test_a_grasp_that_ends_is_forgotten_and_calibrated_taxels_learn_nothing_here() -> None:
    rotation = RotationFriction(STATED)
    turn(rotation, 1.0, 0.06)
    rotation.forget()
    rotation.slip(1.4)
    assert rotation.learned is None
    calibrated = RotationFriction(None)
    turn(calibrated, 1.0, 0.06)
    assert calibrated.learned is None


def test_a_spin_uses_more_friction_than_mu_says_and_never_less() -> None:
    assert FrictionState(0.32).spin_scale == 1.0
    assert FrictionState(None, mu_rotation=0.08).spin_scale == 1.0
    assert FrictionState(0.32, mu_rotation=0.08).spin_scale == pytest.approx(4.0)
    assert FrictionState(0.32, mu_rotation=0.40).spin_scale == 1.0
