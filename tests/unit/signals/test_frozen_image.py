"""An array that hangs is reported; a pad that repeats an image now and then, or rests with its load, is not."""

from __future__ import annotations

import csv
import math

import numpy as np
import pytest
from project import TRIAL

from slipd.signals.taxel_health import FrozenImage

MS = 1_000_000


@pytest.mark.parametrize("rate_hz", [30.0, 60.0, 200.0, 500.0])
@pytest.mark.parametrize("seed", range(5))
def test_T3_an_array_that_hangs_while_the_force_moves_is_reported_within_100_ms(rate_hz: float, seed: int) -> None:
    """From its first image that should have differed, with the times of receipt a millisecond to and fro."""
    rng, watch, told_s = np.random.default_rng(seed), FrozenImage(0.2), math.inf
    images = rng.normal(size=(round(rate_hz), 128))
    for k in range(2 * round(rate_hz)):
        t_ns = round(k * 1e9 / rate_hz + MS * rng.uniform(-1.0, 1.0))
        moved_n = 3.0 * math.sin(6.0 * k / rate_hz) if k < rate_hz else 6.0 * (k / rate_hz - 1.0)
        if watch.update(images[min(k, len(images) - 1)].copy(), t_ns, 5.0 + moved_n):
            told_s = min(told_s, t_ns * 1e-9)
    assert 1.0 < told_s <= round(rate_hz) / rate_hz + 0.100
    assert not watch.update(rng.normal(size=128), 3_000 * MS, 5.0)


def test_T3_an_array_may_rest_as_long_as_its_load_does() -> None:
    watch = FrozenImage(0.2)
    for k in range(1000):
        assert not watch.update(np.ones(4), k * 10 * MS, 5.0 + 0.09 * math.sin(k))
    assert watch.update(np.ones(4), 10_000 * MS, 5.3)
    blind = FrozenImage(0.2)
    assert not any(blind.update(np.ones(4), k * 10 * MS, None if k % 2 else math.nan) for k in range(1000))


def test_T3_the_repeated_images_of_a_real_pad_are_no_fault() -> None:
    with (TRIAL / "robot_state.csv").open(encoding="utf-8") as file:
        times_ns = [round(float(row["time"]) * 1e9) for row in csv.DictReader(file)]
    for sensor in (1, 2):
        readings = np.loadtxt(TRIAL / f"xela_sensor{sensor}.csv", delimiter=",", skiprows=1)
        assert (readings[1:] == readings[:-1]).all(axis=1).mean() > 0.05
        watch = FrozenImage(100.0)
        for t_ns, row in zip(times_ns, readings, strict=True):
            assert not watch.update(row, t_ns, float(row[2:48:3].sum()))


def test_T3_an_image_that_repeats_while_the_force_moves_is_suspect_at_once() -> None:
    watch = FrozenImage(0.2)
    for t_ms, normal_n, suspect in ((0, 5.0, False), (10, 5.1, False), (20, 5.3, True), (30, 5.3, True)):
        assert not watch.update(np.ones(4), t_ms * MS, normal_n)
        assert watch.suspect is suspect
    assert not watch.update(np.zeros(4), 40 * MS, 9.0)
    assert not watch.suspect
