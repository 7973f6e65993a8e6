"""Three rules that distribute the normal force over the taxels, each with the balance that it promises."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slipd.fusion import binary_loads, grey_loads, matched_loads, tipping_margin

PITCH = 3.2e-3


def contact(seed: int, decades: float = 2.0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    taxels = rng.choice(128, int(rng.integers(1, 40)), replace=False)
    x, y = (taxels % 16) * PITCH, (taxels // 16) * PITCH
    pressure = 10.0 ** -rng.uniform(0.0, decades, x.size)
    return x, y, pressure, rng.uniform(0, (16 * PITCH, 8 * PITCH))


@settings(max_examples=300, deadline=None)
@given(seed=st.integers(0, 10**6), rule=st.sampled_from(["binary", "matched"]), decades=st.floats(0.0, 6.0))
def test_the_loads_balance_the_force_at_the_centroid_or_as_near_as_the_hull_allows(
    seed: int, rule: str, decades: float
) -> None:
    x, y, p, c = contact(seed, decades)
    found = binary_loads(x, y, 3.0, c) if rule == "binary" else matched_loads(x, y, p, 3.0, c)
    assert (found.loads >= 0.0).all()
    assert found.loads.sum() == pytest.approx(3.0)
    reached = np.array((found.loads @ x, found.loads @ y)) / 3.0
    outside = max(0.0, -tipping_margin(x, y, c))
    assert (np.hypot(*(reached - c)), found.centroid_residual_m) == pytest.approx((outside, outside), abs=1e-7)
    assert found.status == ("projected" if outside > 1e-7 else "ok")


def test_a_light_taxel_beside_a_heavy_one_takes_its_share_where_the_centroid_is_near_it() -> None:
    """A full Newton step overshoots here to where one taxel carries all and the curvature vanishes."""
    x, y = np.array((14.0, 14.0)) * PITCH, np.array((0.0, 7.0)) * PITCH
    found = matched_loads(x, y, [0.0171, 0.91], 3.0, (7.7 * PITCH, 0.52 * PITCH))
    assert found.loads == pytest.approx([3.0 * (1 - 0.52 / 7), 3.0 * 0.52 / 7])


def test_grey_loads_follow_the_pressures() -> None:
    found = grey_loads([1.0, 3.0, 0.0, -2.0], 8.0)
    assert found.loads == pytest.approx([2.0, 6.0, 0.0, 0.0])
    assert (found.status, found.centroid_residual_m) == ("ok", 0.0)


def test_binary_loads_are_linear_where_no_taxel_would_be_pulled() -> None:
    x, y = (a.ravel() for a in np.meshgrid(np.arange(4) * PITCH, np.arange(3) * PITCH))
    loads = binary_loads(x, y, 6.0, (x.mean() + 0.2 * PITCH, y.mean())).loads
    linear = np.column_stack((np.ones(12), x, y))
    assert loads == pytest.approx(linear @ np.linalg.lstsq(linear, loads, rcond=None)[0], abs=1e-12)


def test_one_taxel_takes_the_whole_load_and_one_without_pressure_stays_empty() -> None:
    for at_m, away_m, status in (((0.013, 0.004), 0.005, "projected"), ((0.01, 0.0), 0.0, "ok")):
        found = matched_loads([0.01], [0.0], [5.0], 2.0, at_m)
        told = found.loads.tolist(), found.centroid_residual_m, found.status
        assert told == ([2.0], pytest.approx(away_m), status)
    loads = matched_loads([0, 1, 2, 3], [0, 0, 0, 1], [1, 0, 1, 1], 1.0, (1.2, 0.2)).loads
    assert (loads[1], loads.sum()) == (0.0, pytest.approx(1.0))


def test_matched_loads_keep_an_image_that_already_balances() -> None:
    x, y, p, _ = contact(5)
    c = (p @ x / p.sum(), p @ y / p.sum())
    assert matched_loads(x, y, p, 2.0, c).loads == pytest.approx(grey_loads(p, 2.0).loads)


def test_a_centroid_on_an_edge_loads_that_edge_alone() -> None:
    x, y = (a.ravel() for a in np.meshgrid(np.arange(3.0), np.arange(3.0)))
    for found in (binary_loads(x, y, 1.0, (0.7, -0.5)), matched_loads(x, y, np.ones(9), 1.0, (0.7, -0.5))):
        assert found.status == "projected"
        assert found.centroid_residual_m == pytest.approx(0.5)
        assert (found.loads[y > 0] == 0.0).all()
        assert found.loads @ x == pytest.approx(0.7)


def test_without_an_image_the_status_is_no_image_and_all_loads_are_zero() -> None:
    for found in (
        grey_loads([0.0, -1.0], 2.0),
        binary_loads([], [], 2.0, (0, 0)),
        matched_loads([0, 1], [0, 0], [0, 0], 2.0, (0, 0)),
    ):
        told = found.status, found.loads.any(), math.isnan(found.centroid_residual_m)
        assert told == ("no_image", False, True)
