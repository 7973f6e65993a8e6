"""Noise and vibration change a level at most once a minute; a load that grows passes each level once."""

from __future__ import annotations

import numpy as np
import pytest
from load_course import MU, contact_rows

from slipd.config import Levels, Slip
from slipd.fusion.levels import ContactWatch, Uncertainty


@pytest.mark.parametrize("share", [0.60, 0.64, 0.67, 0.70, 0.75, 0.80, 0.84])
@pytest.mark.parametrize("std_n", [0.02, 0.2])
def test_noise_changes_the_level_of_a_steady_hold_at_most_once_a_minute(share: float, std_n: float) -> None:
    count = 60_000
    noise = np.random.default_rng(5).normal(0.0, std_n, count)
    load = share * 10.0 * MU + noise
    rows = contact_rows(count, load, 10.0, load / 10.0 / MU, np.arange(count) * 1e-3)
    watch = ContactWatch(Levels(), Slip(), 0.001, 0.3)
    watch.assess(rows, MU, Uncertainty(0.02), 0.0)
    changes = np.count_nonzero(np.diff(rows["assessment"]["level"][500:]))
    assert changes <= 1


@pytest.mark.parametrize("share", [0.55, 0.6, 0.65, 0.7, 0.75, 0.8])
def test_F5_a_vibration_changes_the_level_at_most_once_a_minute(share: float) -> None:
    count = 60_000
    t = np.arange(count) * 1e-3
    load = (share + 0.08 * np.sin(2.0 * np.pi * 120.0 * t)) * 10.0 * MU
    load += np.random.default_rng(6).normal(0.0, 0.02, count)
    rows = contact_rows(count, load, 10.0, load / 10.0 / MU, t)
    watch = ContactWatch(Levels(), Slip(), 0.001, 0.3)
    watch.assess(rows, MU, Uncertainty(0.02), 0.0)
    assert np.count_nonzero(np.diff(rows["assessment"]["level"][500:])) <= 1
    assert not rows["assessment"]["slips"].any()


def test_a_slow_load_passes_each_level_once_on_its_way_up() -> None:
    count = 4000
    load = np.linspace(0.4, 0.99, count) * 10.0 * MU + np.random.default_rng(7).normal(0.0, 0.02, count)
    rows = contact_rows(count, load, 10.0, load / 10.0 / MU, np.arange(count) * 1e-3)
    watch = ContactWatch(Levels(), Slip(), 0.001, 0.3)
    watch.assess(rows, MU, Uncertainty(0.02), 0.0)
    assert np.count_nonzero(np.diff(rows["assessment"]["level"])) == 2
