"""The half-spaces of a pad beside the exact solver of the friction limit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.fusion import utilisation
from slipd.fusion.held_pad import NET_SHARE, twist_net
from slipd.fusion.motion_scale import follow_gravity


@pytest.mark.parametrize(
    ("cols", "rows", "power"), [(16, 8, 1), (12, 2, 1), (5, 5, 3), (3, 1, 1), (2, 2, 2), (1, 1, 1)]
)
def test_the_net_of_twists_leaves_out_no_more_of_the_limit_than_its_share_allows_for(
    cols: int, rows: int, power: int
) -> None:
    rng = np.random.default_rng(cols)
    x, y = (each.ravel() * 0.004 for each in np.meshgrid(np.arange(cols), np.arange(rows)))
    shares = rng.random(x.size) ** power
    shares /= shares.sum()
    cx, cy = float(shares @ x) + 0.0005, float(shares @ y)
    net = twist_net(x, y, shares, cx, cy)
    for load in rng.normal(size=(25, 3)) * (1.0, 1.0, 0.004):
        exact = utilisation(x, y, shares, 1.0, load[:2], load[2], (cx, cy))
        found = np.abs(load @ net[:3] / net[3]).max()
        assert found <= exact.upper * (1.0 + 1e-9)
        assert found / NET_SHARE >= 0.995 * min(exact.lower, 1e6)


def test_gravity_is_followed_through_a_turn() -> None:
    times = np.linspace(0.0, 1.0, 101)
    points = np.zeros((101, 10))
    points[:, 0], points[:, 4] = (
        times,
        math.pi * (1.0 - np.cos(2.0 * math.pi * times)),
    )  # 180° about x, from rest to rest
    found = np.empty((101, 3))
    follow_gravity(points, np.array((1.0, 0.0, -9.0)), found)
    assert found[-1] == pytest.approx((1.0, 0.0, 9.0), abs=1e-3)
