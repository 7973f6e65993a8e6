"""Means leave out values that are not finite, and never return a denormal."""

from __future__ import annotations

import math
from itertools import repeat

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal

from slipd.signals.averaging import LARGEST_READING, Average, flushed, most_std


def average(readings: np.ndarray) -> Average:
    found = Average(readings.shape[1:])
    for reading in readings:
        found.add(reading)
    return found


@given(arrays(np.float64, (20, 3), elements=st.floats(-100.0, 100.0)))
def test_mean_and_spread_are_those_of_numpy(readings: np.ndarray) -> None:
    found = average(readings)
    assert found.count == 20
    assert_allclose(found.mean, readings.mean(axis=0), atol=1e-9)
    assert_allclose(found.std, readings.std(axis=0, ddof=1), atol=1e-6)


def test_a_small_spread_beside_a_large_offset_keeps_its_digits() -> None:
    readings = 1e9 + np.array([[0.0], [1.0], [2.0]])
    assert_allclose(average(readings).std, (1.0,))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e308, -2 * LARGEST_READING])
@pytest.mark.parametrize("at", [0, 5])
def test_N1_N3_a_reading_that_is_no_reading_stays_out(bad: float, at: int) -> None:
    readings = np.ones((10, 2))
    readings[at, 1] = bad
    found = average(readings)
    assert found.count == 9
    assert_array_equal(found.mean, (1.0, 1.0))
    assert_array_equal(found.std, (0.0, 0.0))


def test_N4_a_mean_is_never_denormal() -> None:
    found = average(np.fromiter(repeat(5e-324, 10), dtype=float).reshape(10, 1))
    assert_array_equal(found.mean, (0.0,))
    assert_array_equal(found.std, (0.0,))
    assert_array_equal(flushed(np.array((5e-324, -1e-300, 1e-20, -2.0))), (0.0, 0.0, 1e-20, -2.0))


def test_noise_that_is_not_stated_sets_no_limit() -> None:
    assert_allclose(most_std(np.array((0.0, 0.02))), (math.inf, 0.1))
