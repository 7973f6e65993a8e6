"""A change of the gripper's width at unchanged command, beyond its resolution and its noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from chirps import chirp

from slipd.motion.evidence import REFERENCE, Evidence, f_surprise
from slipd.motion.width_change import WidthChange

STEP_M = 0.085 / 255
PERIOD_NS = 20_000_000
T0 = 10**11
CERTAIN = 11.5


def watch(widths_m: np.ndarray, step_m: float = 0.0, change: WidthChange | None = None) -> list[Evidence]:
    """Return the evidence in readings of one hold at 50 Hz."""
    change = change or WidthChange(step_m)
    found = (change.update(T0 + k * PERIOD_NS, width, held=True, command=20.0) for k, width in enumerate(widths_m))
    return [evidence for evidence in found if evidence is not None]


def steps(widths_m: np.ndarray) -> np.ndarray:
    return np.round(widths_m / STEP_M) * STEP_M


@pytest.mark.parametrize(("step_m", "moved_m"), [(0.0, 5e-4), (STEP_M, 1.3e-3)])
def test_a_hold_whose_width_changes_is_found(step_m: float, moved_m: float) -> None:
    noise = np.random.default_rng(1).normal(0.0, 1e-5, 200)
    rolls = 0.03 - moved_m * np.clip((np.arange(200) - 100) / 20.0, 0.0, 1.0) + noise
    found = watch(steps(rolls) if step_m else rolls, step_m)
    assert found[0].t_ns > T0 + 100 * PERIOD_NS
    assert found[-1].surprise > CERTAIN
    assert found[-1].kind == "width"


T_S = np.arange(3000) * 0.02


@pytest.mark.parametrize(
    ("widths_m", "step_m"),
    [
        (steps(0.03 + STEP_M * (np.arange(2000) // 37 % 2)), STEP_M),  # one step of a coarse gripper
        (0.03 + 1e-3 * np.sin(2.0 * math.pi * 2.0 * T_S[:1000]) * (T_S[:1000] > 1.0), 0.0),  # it is shaken
        (0.03 - 2e-4 * np.log1p(T_S), 0.0),  # the pads creep
    ],
)
def test_what_flickers_swings_back_or_creeps_is_none(widths_m: np.ndarray, step_m: float) -> None:
    assert watch(widths_m, step_m) == []


@pytest.mark.parametrize("std_m", [1e-5, 2e-4, 1e-3])
@pytest.mark.parametrize("keeps", [0.0, 0.99])
def test_noise_is_as_rare_as_it_says(std_m: float, keeps: float) -> None:
    noise = np.random.default_rng(5).normal(0.0, std_m * math.sqrt(1.0 - keeps**2), (40, 1000))
    for k in range(1, 1000):
        noise[:, k] += keeps * noise[:, k - 1]
    found = sum(evidence.surprise > 8.0 for hold in noise for evidence in watch(0.03 + hold))
    assert found <= 1 + 5.0 * 40 * 90 * math.exp(-8.0)


@pytest.mark.statistics
@pytest.mark.parametrize("walk_m", [1e-6, 1e-4])
def test_a_width_that_walks_for_twenty_minutes_is_as_rare_as_it_says(walk_m: float) -> None:
    steps_m = np.random.default_rng(6).normal(0.0, walk_m, 60_000)
    found = watch(0.03 + np.cumsum(steps_m))
    assert sum(evidence.surprise > 8.0 for evidence in found) <= 6_000 * math.exp(-8.0)


@pytest.mark.parametrize("std_m", [1e-5, 1e-4])
def test_a_jump_is_as_surprising_after_twenty_minutes_as_after_ten_seconds(std_m: float) -> None:
    surprises = []
    for held in (500, 3_000, 60_000):
        change = WidthChange(0.0)
        widths = 0.03 + np.random.default_rng(7).normal(0.0, std_m, held + 50) - 1e-3 * (np.arange(held + 50) >= held)
        surprises.append(max(evidence.surprise for evidence in watch(widths, change=change)))
    assert min(surprises) > CERTAIN
    assert max(surprises) < 1.5 * min(surprises)


def test_a_jump_without_noise_is_as_surprising_as_the_least_variance_says() -> None:
    found = watch(np.where(np.arange(130) < 100, 0.03, 0.0295))
    assert found[0].surprise == pytest.approx(f_surprise(25e-8 / 1e-12, 1, REFERENCE - 1), rel=0.01)


@pytest.mark.parametrize(
    ("step_m", "expected"),
    [
        (0.0, [31.6235, 29.4948, 28.9525, 28.8165, 28.5415]),
        (1e-4, [18.0274, 17.2314, 16.8463, 16.5107, 16.3507]),
    ],
)
def test_the_surprise_of_a_width_that_walks_and_falls_twice_keeps_its_digits(
    step_m: float, expected: list[float]
) -> None:
    k = np.arange(400)
    falls = 3e-4 * (k >= 300) + 2e-4 * (k >= 340)
    found = watch(0.03 + 2e-5 * chirp(400) + 3e-6 * chirp(400, turn=0.7).cumsum() - falls, step_m)
    assert [(evidence.t_ns - T0) / PERIOD_NS for evidence in found] == [355, 366, 377, 388, 399]
    assert [evidence.surprise for evidence in found] == pytest.approx(expected, abs=1e-3)


def test_another_command_or_an_unknown_width_begins_another_hold_and_a_release_ends_it() -> None:
    change, ends = WidthChange(0.0), T0 + 200 * PERIOD_NS
    watch(np.full(100, 0.03), change=change)
    for k in range(100):
        assert change.update(T0 + (100 + k) * PERIOD_NS, 0.028, held=True, command=25.0) is None
    assert change.update(ends, None, held=True, command=25.0) is None
    assert change.update(ends + PERIOD_NS, 0.020, held=False, command=25.0) is None
    assert watch(np.full(100, 0.02), change=change) == []


def test_a_confirmed_change_is_not_found_again() -> None:
    change = WidthChange(0.0)
    assert watch(np.where(np.arange(150) < 100, 0.03, 0.029), change=change)
    change.confirm()
    assert watch(np.full(400, 0.029), change=change) == []
