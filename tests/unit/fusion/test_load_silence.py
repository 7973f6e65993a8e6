"""Readings that are lost, late, in bunches or jittering: the load is followed across them, and noise stays noise."""

from __future__ import annotations

import numpy as np
import pytest
from load_course import MU, contact_rows, line, slips_at

from slipd.config import Levels, Slip
from slipd.fusion.levels import ContactWatch, Uncertainty
from slipd.fusion.rows import UNSOLVED, Rows
from slipd.types.arrays import Array

NORMAL_N = 10.0
STD_N = 0.02
RISE = (2.0, 6.0, 800)


def assessed(rows: Rows) -> list[int]:
    """Return the readings at which a slip begins."""
    watch = ContactWatch(Levels(), Slip(), 0.001, 0.3)
    watch.assess(rows, MU, Uncertainty(STD_N), 0.0)
    return slips_at(rows["assessment"])


def readings(load: Array, t_s: Array, *, std_n: float = STD_N, seed: int = 3) -> Rows:
    """Return readings of a load, N, with noise, at times, s."""
    pulled = load + np.random.default_rng(seed).normal(0.0, std_n, len(load))
    return contact_rows(len(load), pulled, NORMAL_N, pulled / NORMAL_N / MU, 100.0 + t_s)


def with_a_silence(load: Array, begin: int, count: int, *, late_image: bool) -> list[int]:
    """Return at which readings of a course at 1 kHz a slip begins, with readings or images missing."""
    n = len(load)
    rows = readings(load, np.arange(n) * 1e-3)
    missing = (np.arange(n) >= begin) & (np.arange(n) < begin + count)
    if late_image:
        rows["utilisation"]["kind"][missing] = UNSOLVED
        return assessed(rows)
    return np.flatnonzero(~missing)[assessed(rows[~missing])].tolist()


def bunches(count: int, hz: float, size: int) -> Array:
    """Return the times, s, of readings that come in bunches: each spans an eighth of the time that it stands for."""
    number = np.arange(count)
    return np.asarray(((number // size + 1) * size - 1 - 0.12 * (size - 1 - number % size)) / hz)


def jittering(count: int, hz: float, seed: int) -> Array:
    return np.asarray((np.arange(count) + np.random.default_rng(seed).uniform(-0.45, 0.45, count)) / hz)


@pytest.mark.parametrize(("begin", "count"), [(770, 15), (780, 3), (795, 20), (740, 50), (760, 1)])
def test_a_slip_is_seen_across_late_images(begin: int, count: int) -> None:
    """On a busy machine, images that came 15 ms late hid a slip of 14 mm on both fingers."""
    course = line(RISE, (6.0, 4.5, 3), (4.5, 4.5, 300))
    (at,) = with_a_silence(course, begin, count, late_image=True)
    assert 803 <= at <= 815 + 2 * max(0, begin + count - 800)


def test_without_images_the_friction_ratio_shows_a_slip() -> None:
    (at,) = with_a_silence(line(RISE, (6.0, 4.5, 3), (4.5, 4.5, 300)), 400, 1000, late_image=True)
    assert 803 <= at <= 815


@pytest.mark.parametrize("late_image", [False, True])
@pytest.mark.parametrize(("hz", "decay"), [(15.0, 20.0), (45.0, 60.0)])
@pytest.mark.parametrize("begin", [500, 510, 530])
def test_a_load_that_jumps_and_swings_in_a_silence_is_no_slip(
    begin: int, hz: float, decay: float, late_image: bool
) -> None:
    """A crest without its rise, next to what was before, looked like a fall to a plateau."""
    t_s = np.arange(600) * 1e-3
    swing = 5.0 - 3.0 * np.exp(-decay * t_s) * np.cos(2.0 * np.pi * hz * t_s)
    course = np.concatenate((np.full(500, 2.0), swing))
    assert with_a_silence(course, begin, 30, late_image=late_image) == []


@pytest.mark.parametrize(("hz", "size", "within_s"), [(100.0, 2, 0.04), (100.0, 4, 0.08), (400.0, 8, 0.04)])
@pytest.mark.parametrize("seed", range(3))
def test_a_slip_is_seen_in_readings_that_come_in_bunches(hz: float, size: int, within_s: float, seed: int) -> None:
    load = line((2.0, 6.0, round(0.8 * hz)), (6.0, 4.5, round(0.01 * hz)), (4.5, 4.5, round(0.3 * hz)))
    t_s = bunches(len(load), hz, size)
    (at,) = assessed(readings(load, t_s, seed=seed))
    assert 0.0 < t_s[at] - 0.8 <= within_s


@pytest.mark.parametrize("seed", range(5))
def test_jitter_of_the_times_hides_no_slow_fall(seed: int) -> None:
    """Single steps of time differ by a factor of ten: the rate of a fall needs their mean."""
    part = np.linspace(0.0, 1.0, 90)
    fall = 6.0 * (1.0 - 0.12 * (1.0 - (1.0 - part) ** 2))
    load = np.concatenate((np.linspace(2.4, 6.0, 1000), fall, np.full(200, fall[-1])))
    (at,) = assessed(readings(load, jittering(len(load), 1000.0, seed), seed=5))
    assert 1000 < at <= 1090


@pytest.mark.parametrize(("size", "std_n"), [(4, 0.06), (2, 0.1)])
def test_F5_noise_in_bunches_is_no_slip(size: int, std_n: float) -> None:
    """In 36 minutes. It is larger than stated, and the lines that join the bunches have none of it."""
    load = np.full(72_000, 5.0)
    t_s = bunches(len(load), 100.0, size)
    assert sum(len(assessed(readings(load, t_s, std_n=std_n, seed=seed))) for seed in range(3)) <= 1


@pytest.mark.parametrize("first_s", [0.025, 0.002])
def test_readings_too_far_apart_show_no_fall_whatever_the_first_step_of_time_was(first_s: float) -> None:
    """A pad of 40 Hz that sends each reading four times sees steps: they are no falls to a plateau."""
    for seed in range(10):
        steps = np.random.default_rng(seed).normal(0.0, 0.2, 300)
        load = np.repeat(np.clip(4.0 + np.cumsum(steps), 1.0, 5.9), 4)
        t_s = np.arange(len(load)) / 40.0
        t_s[0] = t_s[1] - first_s
        assert assessed(readings(load, t_s, std_n=0.002, seed=seed)) == []
