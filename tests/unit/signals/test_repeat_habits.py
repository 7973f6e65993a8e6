"""Repeats that a sensor is used to are neither stuck nor suspect, at any rate; what it is not used to is."""

from __future__ import annotations

import numpy as np
import pytest
from watched_wrench import MS, take

from slipd.signals.frozen import Habit, WrenchWatch


def watched(rate_hz: float, readings: np.ndarray) -> tuple[list[str], list[bool]]:
    """Return what is said of readings that come one by one, and whether each is suspect."""
    watch = WrenchWatch(200.0, gap_ns=200 * MS)
    said, suspect = [], []
    for k, six in enumerate(readings):
        said.append(take(watch, six[:3], six[3:], round(k * 1e9 / rate_hz)))
        suspect.append(watch.suspect)
    return said, suspect


@pytest.mark.parametrize("rate_hz", [30.0, 43.0, 60.0, 100.0, 200.0, 500.0, 1000.0, 4000.0])
def test_F1_at_any_rate_a_repeat_is_suspect_at_once_and_a_stuck_sensor_is_reported_within_100_ms(
    rate_hz: float,
) -> None:
    live, late = round(2.0 * rate_hz), round(0.1 * rate_hz)
    readings = np.random.default_rng(3).normal(size=(live, 6))
    said, suspect = watched(rate_hz, np.vstack((readings, np.tile(readings[-1], (live, 1)), readings[:1])))
    assert suspect == [suspect[0], *[False] * (live - 1), *[True] * live, False]
    assert (said.index("stuck") - (live - 1)) / rate_hz <= 0.1
    assert (set(said[live + late : -1]), said[-1]) == ({"stuck"}, "")


@pytest.mark.parametrize("rate_hz", [200.0, 1000.0])
def test_F1_what_a_coarse_sensor_is_used_to_is_neither_stuck_nor_suspect(rate_hz: float) -> None:
    """Its noise is 0.3 counts: more than half of its readings repeat the one before."""
    said, suspect = watched(rate_hz, 0.01 * np.rint(0.3 * np.random.default_rng(4).normal(size=(20_000, 6))))
    assert set(said) == {""}
    assert np.mean(suspect[5_000:]) < 0.01


def test_F1_a_device_that_hands_on_each_conversion_four_times_is_not_suspect() -> None:
    assert not any(watched(1000.0, np.repeat(np.random.default_rng(5).normal(size=(100, 6)), 4, axis=0))[1][20:])


def test_F1_a_sensor_that_hung_twice_is_reported_as_soon_the_third_time() -> None:
    """Runs that are rare, or that were reported, are no habit."""
    rng = np.random.default_rng(6)
    watch = WrenchWatch(200.0)
    t_ns = 0
    for hung_ms in (60, 300, 60, 300, 90):
        for _ in range(200):
            six = rng.normal(size=6)
            t_ns += 5 * MS
            take(watch, six[:3], six[3:], t_ns)
        said = []
        for _ in range(hung_ms // 5):
            t_ns += 5 * MS
            said.append(take(watch, six[:3], six[3:], t_ns))
            assert watch.suspect
    assert said.index("stuck") == 13, "70 ms"


def test_F1_a_habit_is_forgotten() -> None:
    habit = Habit()
    habit.age(0)
    for _ in range(3):
        habit.learn(7)
    for at_s, repeats in ((5, 7), (11, 7), (12, 7), (22, 0)):
        habit.age(at_s * 1_000 * MS)
        assert habit.repeats == repeats
    habit.learn(3)
    habit.age(60_000 * MS)
    assert habit.repeats == 0


def test_F1_a_run_that_ends_with_readings_that_come_together_is_a_habit_too() -> None:
    rng = np.random.default_rng(7)
    watch = WrenchWatch(200.0)
    six, t_ns = rng.normal(size=6), 0
    for k in range(4):
        for _ in range(3):
            t_ns += MS
            take(watch, six[:3], six[3:], t_ns)
        assert watch.suspect is (k < 3), "the fourth time it is used to two repeats"
        rows = rng.normal(size=(2, 6))
        t_ns += 2 * MS
        assert watch.update([*map(tuple, rows.tolist())], [t_ns - MS, t_ns], rows) == {}
        assert watch.lively
        six = rng.normal(size=6)
