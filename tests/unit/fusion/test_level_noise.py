"""Noise and vibration change a level at most once a minute; a load that grows passes each level once."""

from __future__ import annotations

import numpy as np
import pytest
from load_course import MU, contact_rows

from slipd.config import Levels, Slip
from slipd.fusion.levels import ContactWatch, Uncertainty
from slipd.fusion.rows import Rows
from slipd.types.arrays import Array


def assessed(used: Array, std_n: float = 0.02) -> Rows:
    """Return the assessments of a course of the utilisation at 1 kHz, with noise of the load."""
    count = len(used)
    load = used * 10.0 * MU + np.random.default_rng(5).normal(0.0, std_n, count)
    rows = contact_rows(count, load, 10.0, load / 10.0 / MU, np.arange(count) * 1e-3)
    ContactWatch(Levels(), Slip(), 0.001, 0.3).assess(rows, MU, Uncertainty(0.02))
    return rows["assessment"]


@pytest.mark.parametrize("share", [0.55, 0.60, 0.64, 0.67, 0.70, 0.75, 0.80, 0.84])
@pytest.mark.parametrize(("std_n", "swing"), [(0.02, 0.0), (0.2, 0.0), (0.02, 0.08)])
def test_F5_noise_and_vibration_change_the_level_of_a_steady_hold_at_most_once_a_minute(
    share: float, std_n: float, swing: float
) -> None:
    found = assessed(share + swing * np.sin(2.0 * np.pi * 0.12 * np.arange(60_000)), std_n)
    assert np.count_nonzero(np.diff(found["level"][500:])) <= 1
    assert not found["slips"].any()


def test_a_slow_load_passes_each_level_once_on_its_way_up() -> None:
    assert np.count_nonzero(np.diff(assessed(np.linspace(0.4, 0.99, 4000))["level"])) == 2
