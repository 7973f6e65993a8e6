"""Two fingers as one grasp, compared with boxes of known weight and with an independent computation of rotations."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from slipd.fusion import utilisation
from slipd.fusion.grasp import (
    PadPose,
    asymmetry,
    external_wrench,
    grasp_needed_n,
    grasp_utilisation,
    internal_force,
    load_share,
)

NAN, INF = math.nan, math.inf
LEFT = PadPose(np.array(((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0))), np.array((0.0, 0.03, 0.1)))
RIGHT = PadPose(np.array(((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))), np.array((0.0, -0.03, 0.1)))
forces = st.integers(-5000, 5000).map(lambda hundredths: hundredths / 100)
loads = st.floats(0.0, 100.0)
vectors = st.tuples(forces, forces, forces).map(np.array)
"""Pads 60 mm apart that look at each other along the gripper's Y; Z is the approach."""


def on_pad(pose: PadPose, force: np.ndarray, torque_about_origin: np.ndarray) -> np.ndarray:
    """A wrench of the gripper frame, as the pad's sensor feels it: backwards, by quaternions and not by matrices."""
    turn = Rotation.from_matrix(pose.rotation).inv()
    moved = torque_about_origin - np.cross(pose.position_m, force)
    return np.concatenate((turn.apply(force), turn.apply(moved)))


@pytest.mark.parametrize("down", [(1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0.6, 0.8)])
@pytest.mark.parametrize("share", [0.5, 0.2])
def test_a_held_box_shows_its_weight_in_every_orientation(down: tuple[float, ...], share: float) -> None:
    """0.4 kg, its centre of mass 20 mm beyond the pads and 5 mm beside; 12 N of grip; one pad bears ``share`` of it."""
    weight = 0.4 * 9.81 * np.array(down)
    com = np.array((0.005, 0.0, 0.12))
    grip = 12.0 * np.array((0.0, 1.0, 0.0))
    moment = np.cross(com, weight)
    at_left, at_right = LEFT.position_m, RIGHT.position_m
    left = on_pad(LEFT, grip + share * weight, np.cross(at_left, grip) + share * moment)
    right = on_pad(RIGHT, -grip + (1 - share) * weight, np.cross(at_right, -grip) + (1 - share) * moment)
    world = external_wrench((left, right), (LEFT, RIGHT))
    assert world.force_n == pytest.approx(weight)
    assert world.torque_nm == pytest.approx(moment)
    axial = weight[1]
    expected = 12.0 + min(share * axial, -(1 - share) * axial)
    assert internal_force(-left[2], -right[2]) == pytest.approx(expected)


@settings(max_examples=100, deadline=None)
@given(force=vectors, torque=vectors, other=vectors, seed=st.integers(0, 1000))
def test_pads_at_any_pose_give_back_what_the_world_does(force, torque, other, seed) -> None:
    rng = np.random.default_rng(seed)
    poses = [PadPose(Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)) for _ in range(2)]
    parts = ((force - other, torque - 0.1 * other), (other, 0.1 * other))
    wrenches = [on_pad(pose, *part) for pose, part in zip(poses, parts, strict=True)]
    world = external_wrench(wrenches, poses)
    assert world.force_n == pytest.approx(force, abs=1e-9)
    assert world.torque_nm == pytest.approx(torque, abs=1e-8)


def test_without_a_place_or_a_torque_of_a_finger_the_torque_is_unknown_and_the_force_known() -> None:
    lost = PadPose(RIGHT.rotation, None)
    for poses in ((LEFT, lost), (lost, LEFT)):
        assert external_wrench([(1.0, 0.0, -5.0, 0.0, 0.0, 0.0)] * 2, poses).torque_nm is None
    world = external_wrench(((1, 0, -5, NAN, NAN, NAN), (1, 0, -5, 0, 0, 0)), (LEFT, RIGHT))
    assert world.force_n == pytest.approx((0.0, 0.0, 2.0))
    assert np.isnan(world.torque_nm).any()


@pytest.mark.parametrize(
    ("function", "arguments", "found"),
    [
        (internal_force, (10.0, 7.0), 7.0),
        (internal_force, (7.0, 10.0), 7.0),
        (internal_force, (10.0, 0.0), 0.0),  # pushed onto one pad is not gripped
        (internal_force, (10.0, -0.3), 0.0),
        (internal_force, (10.0, NAN), NAN),
        (internal_force, (NAN, 10.0), NAN),
        (internal_force, (10.0, INF), NAN),
        (asymmetry, (6.0, 2.0, 0.5), 0.5),
        (asymmetry, (2.0, 6.0, 0.5), -0.5),
        (asymmetry, (6.0, -0.1, 0.5), 1.0),
        (asymmetry, (5.0, 5.0, 0.5), 0.0),
        (asymmetry, (0.4, 0.3, 0.5), NAN),
        (asymmetry, (-1.0, -1.0, 0.5), NAN),
        (asymmetry, (NAN, 5.0, 0.5), NAN),
        (asymmetry, (5.0, NAN, 0.5), NAN),
        (load_share, (3.0, 1.0, 0.5), 0.75),
        (load_share, (0.2, 0.2, 0.5), NAN),
        (load_share, (NAN, 5.0, 0.5), NAN),
        (load_share, (5.0, NAN, 0.5), NAN),
        (grasp_utilisation, (0.4, 0.9), 0.9),
        (grasp_utilisation, (0.9, 0.4), 0.9),
        (grasp_utilisation, (0.4, INF), INF),
        (grasp_utilisation, (0.4, NAN), NAN),
        (grasp_utilisation, (NAN, 0.4), NAN),
        (grasp_needed_n, ((10.0, 10.0), (4.0, 14.0)), 14.0),
        (grasp_needed_n, ((10.0, 10.0), (4.0, 3.0)), 4.0),
        (grasp_needed_n, ((10.0, 7.0), (12.0, 5.0)), 9.0),  # 3 N towards the first pad: it has 10 N, the grip 7 N
        (grasp_needed_n, ((10.0, 7.0), (5.0, 9.0)), 9.0),
        (grasp_needed_n, ((10.0, 7.0), (INF, 5.0)), INF),
        (grasp_needed_n, ((NAN, 7.0), (5.0, 5.0)), NAN),
        (grasp_needed_n, ((10.0, NAN), (5.0, 5.0)), NAN),
        (grasp_needed_n, ((10.0, 7.0), (NAN, 5.0)), NAN),
        (grasp_needed_n, ((10.0, 7.0), (5.0, NAN)), NAN),
    ],
)
def test_the_worse_finger_decides_and_what_rests_on_an_unknown_one_is_unknown(
    function: Callable[..., float], arguments: tuple[Any, ...], found: float
) -> None:
    assert function(*arguments) == pytest.approx(found, nan_ok=True)


@settings(max_examples=50, deadline=None)
@given(
    fx=st.tuples(forces, forces), fy=st.tuples(forces, forces), spin=st.tuples(forces, forces), seed=st.integers(0, 999)
)
def test_both_contacts_together_carry_at_least_what_the_worse_one_allows(fx, fy, spin, seed) -> None:
    """Both pads seen along the closing axis are one contact of all taxels: its λ for the whole load is no greater."""
    rng = np.random.default_rng(seed)
    x, y, pressed = rng.normal(0.0, 0.01, (2, 6)), rng.normal(0.0, 0.01, (2, 6)), rng.uniform(0.1, 5.0, (2, 6))
    alone = [utilisation(x[i], y[i], pressed[i], 0.5, (fx[i], fy[i]), 0.01 * spin[i], (0.0, 0.0)) for i in (0, 1)]
    together = utilisation(x.ravel(), y.ravel(), pressed.ravel(), 0.5, (sum(fx), sum(fy)), 0.01 * sum(spin), (0.0, 0.0))
    assert together.lower <= grasp_utilisation(*(one.upper for one in alone)) * (1 + 1e-9)


@settings(max_examples=200, deadline=None)
@given(first=loads, second=loads, need_first=loads, need_second=loads)
def test_the_grip_needed_is_the_least_with_which_both_fingers_have_enough(
    first: float, second: float, need_first: float, need_second: float
) -> None:
    needed_n = grasp_needed_n((first, second), (need_first, need_second))
    more_n = needed_n - internal_force(first, second)
    spare = (first + more_n - need_first, second + more_n - need_second)
    assert min(spare) == pytest.approx(0.0, abs=1e-9), "both have enough, one of them just so"
    assert needed_n >= -1e-9
