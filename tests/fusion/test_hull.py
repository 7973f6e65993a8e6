"""Tipping margin against SciPy's hull and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from slipd.fusion import tipping_margin


@settings(max_examples=200, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_margin_inside_is_that_of_an_independent_hull(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.integers(0, (16, 8), (30, 2)).astype(float)
    inside = points.mean(axis=0)
    expected = -(ConvexHull(points).equations @ (*inside, 1.0)).max()
    assert tipping_margin(points[:, 0], points[:, 1], inside) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("point", "margin"),
    [((0.5, 0.5), 0.5), ((0.5, 0.1), 0.1), ((2.0, 0.5), -1.0), ((2.0, 2.0), -math.sqrt(2)), ((0, 0), 0)],
)
def test_the_margin_of_a_square(point, margin) -> None:
    assert tipping_margin([0, 1, 1, 0, 0.5], [0, 0, 1, 1, 0], point) == pytest.approx(margin)


def test_points_and_segments_have_no_inside() -> None:
    assert tipping_margin([1.0], [1.0], (1.0, 1.0)) == 0.0
    assert tipping_margin([1.0, 1.0], [1.0, 1.0], (1.0, 3.0)) == -2.0
    assert tipping_margin([0, 1, 2], [0, 0, 0], (1.0, 0.0)) == 0.0
    assert tipping_margin([0, 1, 2], [0, 0, 0], (1.0, 0.5)) == -0.5


def test_nothing_to_stand_on_is_not_a_number() -> None:
    assert math.isnan(tipping_margin([], [], (0, 0)))
    assert math.isnan(tipping_margin([0, 1, 2], [0, 1, 0], (math.nan, 0)))


def test_a_bad_call_raises() -> None:
    with pytest.raises(ValueError, match="shape"):
        tipping_margin([0, 1], [0], (0, 0))
