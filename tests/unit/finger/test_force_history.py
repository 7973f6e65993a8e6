"""Wrenches of the recent past."""

from __future__ import annotations

import pytest
from finger_bench import MS, T0, Wrench

from slipd.finger.finger import Finger
from slipd.finger.force_image_check import ForceHistory


def test_the_mean_is_that_of_the_readings_between_two_times(finger: Finger, wrench: Wrench) -> None:
    history = ForceHistory(0.02)
    samples = [wrench(T0 + k * MS, 8.0 + k, (1.0, 0.0)) for k in range(6)]
    for batch in finger.decide(samples, [sample.t_ns for sample in samples]):
        history.update(batch.readings.rows, batch.readings.times_ns, batch.phases)
    assert history.mean_wrench(T0 + MS, T0 + 4 * MS)[2] == pytest.approx(-11.0), "of the third to the fifth"
    assert history.mean_wrench(T0 + 5 * MS, T0 + 9 * MS) == history.wrench_at(T0 + 9 * MS), "there is none between"
    assert history.mean_wrench(0, T0) == history.wrench_at(T0)
