"""The half-spaces of a pad beside the exact solver of the friction limit, and what follows from them for a motion."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slipd.fusion import utilisation
from slipd.fusion.held_pad import NET_SHARE, UNBOUNDED, HeldPad, pad_utilisation, tipping_edges, twist_net
from slipd.fusion.motion_limits import nearest_limit, worst_turn
from slipd.fusion.motion_scale import check_points, follow_gravity, force_ratio, largest_scale
from slipd.types.arrays import Array


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
        found = np.abs(load @ net[:3] / np.maximum(net[3], 1e-12)).max()  # a single taxel dissipates nothing in a turn
        assert found <= exact.upper * (1.0 + 1e-9)
        assert found / NET_SHARE >= 0.995 * min(exact.lower, 1e6)


@pytest.mark.parametrize(("axis", "swells"), [((1.0, 0.0, 0.0), 1.0), ((0.6, -0.48, 0.64), 0.0)])
def test_gravity_is_followed_through_a_turn(axis: tuple[float, float, float], swells: float) -> None:
    """By 114°, from rest to rest or at a steady rate: gravity turns the other way, as the gripper sees it."""
    times, found, begin = np.linspace(0.0, 1.0, 101), np.empty((101, 3)), np.array((1.0, 2.0, -9.0))
    rates = (1.0 - swells * np.cos(2.0 * math.pi * times))[:, None] * (2.0 * np.array(axis))
    follow_gravity(np.hstack((times[:, None], np.zeros((101, 3)), rates, np.zeros((101, 3)))), begin, found)
    assert found[-1] == pytest.approx(Rotation.from_rotvec(-2.0 * np.array(axis)).apply(begin), abs=1e-3)


def held(right: bool) -> HeldPad:
    """Return one of two pads that hold an object a little unevenly, of which little is known exactly."""
    x, y = (each.ravel() * 0.004 - 0.006 for each in np.meshgrid(np.arange(4), np.arange(4)))
    shares = 1.0 + 0.3 * np.sin(np.arange(16) + right)
    shares /= shares.sum()
    cx, cy = float(shares @ x), float(shares @ y)
    net, corners_m = twist_net(x, y, shares, cx, cy), 0.006 * np.array(((-1.0, 1.0, 1.0, -1.0), (-1.0, -1.0, 1.0, 1.0)))
    turn = np.array(((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)))
    c, s = math.cos(0.3), math.sin(0.3)
    return HeldPad(
        turn=-turn @ ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, -1.0)) if right else turn,
        lever=np.array((0.003, -0.002, 0.015)),
        lever_error=np.array((0.002, 0.001, 0.003)),
        load=np.array((-0.3, 0.8, -0.003) if right else (0.5, -1.0, 0.004)),
        normal=7.0 if right else 8.0,
        shares=np.array((0.4, 0.6)),
        spin_shares=np.array((0.45, 0.55)),
        mass=np.array((0.2, 0.3)),
        mu=0.5,
        spin_scale=1.5,
        twists=np.vstack((net[:3], 0.01 * np.abs(net[0]))) / (0.5 * net[3]),
        edges=tipping_edges(*corners_m, cx, cy, 0.002),
    )


PADS = held(right=False), held(right=True)
TIPS = PADS[1]._replace(lever=np.array((0.003, -0.002, 0.06)), edges=PADS[1].edges[:, 4::5].copy())
"""Hangs far below the fingers, and tips over slanting edges of the contact."""
WORK = np.empty(PADS[0].twists.shape[1])
PARTS = np.array((1.0, 1.0, 1.0, 0.01, 0.01, 0.01))
STILL, TURNING = np.zeros(6), np.array((1.0, -2.0, 0.5, 0.01, -0.02, 0.015))


@pytest.mark.parametrize(
    ("pad", "rest", "expected"),
    [
        (PADS[0], STILL, (4.093857, -0.08071044, -0.1489215, 0.9039864, 0.4007879)),
        (PADS[0], TURNING, (1.130364, 2.41594, -0.1852463, 0.9472388, -0.261577)),
        (PADS[1], STILL, (6.388693, -1.323199, 0.463178, 0.6893324, 0.557034)),
        (PADS[1], TURNING, (2.89734, 0.6856707, 0.4220111, 0.6796844, -0.5999464)),
    ],
)
def test_the_worst_acceleration_keeps_its_digits(pad: HeldPad, rest: Array, expected: tuple[float, ...]) -> None:
    direction = np.empty(3)
    assert (*nearest_limit(pad, rest, 1.5, 4.0, direction), *direction) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    ("pad", "expected"),
    [
        (PADS[0], (1.247432, 3.84874, -0.2132141, 9.020967)),
        (PADS[1], (1.429579, -5.193964, -4.062605, 7.2632)),
        (TIPS, (2.254398, -5.302236, -5.128812, 6.466659)),
    ],
)
def test_the_worst_orientation_keeps_its_digits(pad: HeldPad, expected: tuple[float, ...]) -> None:
    gravity = np.empty(3)
    assert (worst_turn(pad, np.array((0.5, 1.0, -9.7)), 9.81, gravity), *gravity) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    ("change", "couple", "expected"),
    [
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), [(0.3978151, 4.773781, 8.0, 0.0), (0.3474467, 3.64819, 7.0, 0.0)]),
        ((3.0, -2.0, 4.0), (0.02, -0.01, 0.03), [(0.8104677, 9.178547, 7.55, 0), (0.8458838, 9.320419, 7.345705, 0)]),
        ((0.0, 6.0, -12.0), (0.0, 0.1, 0.0), [(3.052586, 36.63103, 8.0, 0.0), (1.783207, 18.01226, 6.734032, 0.0)]),
        ((0.0, 0.0, 9.0), (0.05, 0.12, 0.0), [(1.060928, 12.73114, 8.0, 0.0), (3.524833, 37.01075, 7.0, 0.0)]),
    ],
)
def test_what_a_motion_uses_of_both_pads_keeps_its_digits(
    change: tuple[float, ...], couple: tuple[float, ...], expected: list[tuple[float, ...]]
) -> None:
    found = [pad_utilisation(pad, change, couple, 1.5, WORK) for pad in PADS]
    assert np.array(found) == pytest.approx(np.array(expected), rel=1e-5)


@pytest.mark.parametrize(
    ("size", "expected", "scales"),
    [
        (1.0, (0.5932274, 5, 0, 0, -0.8739064, 1.0), [2.0, 2.0, 1.546821]),
        (2.0, (0.8201557, 5, 0, 0, 1.800844, 0.6735488), [1.148371, 1.915097, 0.7733403]),
        (6.0, (2.351911, 5, 0, 0, 18.64687, 0.2245296), [0.3827196, 0.6383518, 0.2578]),
    ],
)
def test_how_far_a_motion_must_be_slowed_down_keeps_its_digits(
    size: float, expected: tuple[float, ...], scales: list[float]
) -> None:
    rest = 0.3 * np.sin(np.arange(42.0)).reshape(7, 6) * PARTS
    motion = size * np.cos(1.7 * np.arange(42.0)).reshape(7, 6) * PARTS
    assert check_points(*PADS, rest, motion, 1.5, WORK) == pytest.approx(expected, rel=1e-5)
    found = [largest_scale(*PADS, rest[k], motion[k], 1.5, 2.0, WORK) for k in range(3)]
    assert found == pytest.approx(scales, rel=1e-5)
    ratios = [force_ratio(*PADS, rest[k], motion[k], scale, 1.5, WORK) for k, scale in enumerate(found)]
    assert [0.99 <= ratio <= 1.0 for ratio in ratios] == [scale < 2.0 for scale in found]


def test_a_motion_that_lifts_a_pad_off_is_not_held_and_the_first_such_point_is_told() -> None:
    rest, motion = np.zeros((2, 2, 6))
    motion[:, 0] = -60.0
    found = check_points(*PADS, rest, motion, 1.5, WORK)
    assert found == pytest.approx((UNBOUNDED, 0, 1, 0, UNBOUNDED, 0.1515602), rel=1e-5)
    assert force_ratio(*PADS, rest[0], motion[0], found[5], 1.5, WORK) == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("pads", [PADS, (PADS[0], TIPS)])
@pytest.mark.parametrize(("size", "holds"), [(0.5, True), (1.0, False), (3.0, False), (10.0, False)])
def test_a_point_that_is_not_solved_would_not_have_been_the_worst(
    pads: tuple[HeldPad, HeldPad], size: float, holds: bool
) -> None:
    rest, motion = np.random.default_rng(7).normal(size=(2, 300, 6)) * PARTS * np.array((0.1, size))[:, None, None]
    uses = [[pad_utilisation(pad, tuple(at[:3]), tuple(at[3:]), 1.5, WORK) for pad in pads] for at in rest + motion]
    used, needed, normal, tips = np.array(uses).transpose(2, 0, 1)
    worst = np.unravel_index(used.argmax(), used.shape)
    *found, scale = check_points(*pads, rest, motion, 1.5, WORK)
    assert found == [used[worst], *worst, tips[worst], (needed - normal).max()]
    slowed = [[force_ratio(*pads, rest[k], motion[k], by * scale, 1.5, WORK) for k in range(300)] for by in (1.0, 1.01)]
    assert max(slowed[0]) <= 1.0
    assert (scale == 1.0) if holds else (max(slowed[1]) > 1.0)
