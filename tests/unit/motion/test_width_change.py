"""A change of the gripper's width at unchanged command, beyond its resolution and its noise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.motion.evidence import Evidence
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


def test_one_step_of_a_coarse_gripper_is_none() -> None:
    flicker = 0.03 + STEP_M * (np.arange(2000) // 37 % 2)
    assert watch(steps(flicker), STEP_M) == []


@pytest.mark.parametrize("std_m", [1e-5, 2e-4, 1e-3])
@pytest.mark.parametrize("keeps", [0.0, 0.9, 0.99])
def test_noise_is_as_rare_as_it_says(std_m: float, keeps: float) -> None:
    rng = np.random.default_rng(5)
    found, looks = 0, 0
    for _ in range(40):
        noise, widths = 0.0, []
        for step in rng.normal(0.0, std_m * math.sqrt(1.0 - keeps**2), 1000):
            noise = keeps * noise + step
            widths.append(0.03 + noise)
        found += sum(evidence.surprise > 8.0 for evidence in watch(np.array(widths)))
        looks += 90
    assert found <= 1 + 5.0 * looks * math.exp(-8.0)


def test_a_shaken_gripper_swings_back() -> None:
    t = np.arange(1000) * 0.02
    assert watch(0.03 + 1e-3 * np.sin(2.0 * math.pi * 2.0 * t) * (t > 1.0)) == []


def test_creep_of_the_pads_is_followed() -> None:
    t = np.arange(3000) * 0.02
    assert watch(0.03 - 2e-4 * np.log1p(t)) == []


def test_another_command_begins_another_hold() -> None:
    change = WidthChange(0.0)
    watch(np.full(100, 0.03), change=change)
    for k in range(100):
        assert change.update(T0 + (100 + k) * PERIOD_NS, 0.028, held=True, command=25.0) is None
    assert change.update(T0 + 200 * PERIOD_NS, None, held=True, command=25.0) is None
    assert change.update(T0 + 201 * PERIOD_NS, 0.020, held=False, command=25.0) is None


def test_a_confirmed_change_is_not_found_again() -> None:
    change = WidthChange(0.0)
    widths = np.where(np.arange(400) < 100, 0.03, 0.029)
    first = next(
        k for k, w in enumerate(widths) if change.update(T0 + k * PERIOD_NS, w, held=True, command=20.0) is not None
    )
    change.confirm()
    later = range(first + 1, 400)
    assert all(change.update(T0 + k * PERIOD_NS, widths[k], held=True, command=20.0) is None for k in later)
