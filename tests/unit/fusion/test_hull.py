"""Tipping margin against SciPy's hull and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from slipd.fusion import tipping_margin
from slipd.fusion.hull import Outline, fill_margins
from slipd.fusion.rows import READING, new_rows


@settings(max_examples=60, deadline=None)
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


@settings(max_examples=50)
@given(seed=st.integers(0, 10**6), taxels=st.integers(1, 12))
def test_the_margins_of_many_points_are_those_of_each(seed: int, taxels: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = rng.integers(0, (8, 4), (taxels, 2)).astype(float).T.copy()
    points = rng.uniform(-2.0, 10.0, (20, 2))
    points[::7, rng.integers(2)] = (math.nan, math.inf, -math.inf)
    outline, readings = Outline(x, y), new_rows(READING, 20)
    readings["contact"]["cx_m"], readings["contact"]["cy_m"] = points.T
    readings["tipping_margin_m"] = math.nan
    fill_margins(outline.x, outline.y, readings)
    found = readings["tipping_margin_m"]
    assert np.array_equal(found, [outline.margin_m(px, py) for px, py in points.tolist()], equal_nan=True)
    assert np.isnan(found[::7]).all()
    for (px, py), margin in zip(points.tolist(), found, strict=True):
        assert np.array_equal(margin, tipping_margin(x, y, (px, py)), equal_nan=True)


@pytest.mark.parametrize(
    ("x", "y", "point", "margin"),
    [
        ([1.0], [1.0], (1.0, 1.0), 0.0),
        ([1.0, 1.0], [1.0, 1.0], (1.0, 3.0), -2.0),
        ([0, 1, 2], [0, 0, 0], (1.0, 0.0), 0.0),
        ([0, 1, 2], [0, 0, 0], (1.0, 0.5), -0.5),
        ([], [], (0, 0), math.nan),
        ([0, 1, 2], [0, 1, 0], (math.nan, 0), math.nan),
    ],
)
def test_points_and_segments_have_no_inside_and_nothing_to_stand_on_is_no_number(x, y, point, margin) -> None:
    assert tipping_margin(x, y, point) == pytest.approx(margin, nan_ok=True)
