"""A drop of R is a slip only when the load itself gives way, quickly, from near the limit."""

from __future__ import annotations

import math

import numpy as np

from slipd.fusion import SlipDetector, SlipSettings

MU = 0.6


def told(
    tangential: np.ndarray, normal: np.ndarray, *, mu: float = MU, settings: SlipSettings | None = None
) -> list[int]:
    """Milliseconds at which a slip is told, readings coming at 1 kHz."""
    detector = SlipDetector(settings or SlipSettings())
    return [
        k
        for k, (ft, fn) in enumerate(zip(tangential, normal, strict=True))
        if detector.update(k * 1e-3, ft, fn, ft / fn / mu)
    ]


def test_the_fall_from_static_to_dynamic_friction_is_told_at_once() -> None:
    load = np.concatenate((np.linspace(2.0, 6.0, 400), np.full(200, 4.5)))
    noise = np.random.default_rng(0).normal(0, 0.02, 600)
    found = told(load + noise, np.full(600, 10.0))
    assert 400 <= found[0] <= 402


def test_a_slip_stays_told_for_its_hold_time() -> None:
    load = np.concatenate((np.full(100, 6.0), np.full(900, 4.5)))
    found = told(load, np.full(1000, 10.0))
    assert found == list(range(found[0], found[0] + 250))


def test_a_tightened_grip_is_no_slip() -> None:
    assert (
        told(np.full(300, 5.5), np.concatenate((np.full(100, 10.0), np.linspace(10, 25, 50), np.full(150, 25.0)))) == []
    )


def test_setting_an_object_down_is_no_slip() -> None:
    slowly = np.concatenate((np.full(100, 5.5), np.linspace(5.5, 0.0, 600)))
    assert told(slowly, np.full(700, 10.0)) == []


def test_a_load_that_gives_way_far_from_the_limit_is_no_slip() -> None:
    assert told(np.concatenate((np.full(100, 2.0), np.full(100, 1.0))), np.full(200, 10.0)) == []


def test_opening_the_gripper_is_no_slip_while_r_stays() -> None:
    fall = np.concatenate((np.full(100, 1.0), np.linspace(1.0, 0.2, 60)))
    assert told(5.0 * fall, 10.0 * fall) == []


def test_an_unknown_utilisation_arms_nothing() -> None:
    detector = SlipDetector(SlipSettings())
    assert not any(detector.update(k * 1e-3, 6.0 if k < 50 else 3.0, 10.0, math.nan) for k in range(200))


def test_reset_forgets_a_slip() -> None:
    detector = SlipDetector(SlipSettings())
    for k in range(60):
        slips = detector.update(k * 1e-3, 6.0 if k < 50 else 4.0, 10.0, 0.9)
    assert slips
    detector.reset()
    assert not detector.update(0.061, 4.0, 10.0, 0.7)
