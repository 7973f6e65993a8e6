"""The arm's orientation from transforms and IMU messages, judged by SciPy's rotations."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slipd_client.ros2.orientation import (
    STALE_S,
    ImuOrientation,
    OrientationUnknown,
    TransformTree,
    pad_gravities,
)

PADS = {"left": (0.5, -0.5, 0.5, 0.5), "right": (-0.5, -0.5, -0.5, 0.5)}
DOWN_MPS2 = np.array([0.0, 0.0, -9.80665])


def rotations(count: int) -> list[Rotation]:
    return list(Rotation.random(count, random_state=7))


def header(frame: str, stamp_ns: int) -> SimpleNamespace:
    sec, nanosec = divmod(stamp_ns, 10**9)
    return SimpleNamespace(frame_id=frame, stamp=SimpleNamespace(sec=sec, nanosec=nanosec))


def quaternion(rotation: Rotation) -> SimpleNamespace:
    return SimpleNamespace(**dict(zip("xyzw", map(float, rotation.as_quat()), strict=True)))


def transform(parent: str, child: str, rotation: Rotation, stamp_ns: int = 1) -> Any:
    return SimpleNamespace(
        header=header(parent, stamp_ns),
        child_frame_id=child,
        transform=SimpleNamespace(rotation=quaternion(rotation), translation=SimpleNamespace(x=0.0, y=0.0, z=0.0)),
    )


def imu(rotation: Rotation, stamp_ns: int = 1, variance: float = 0.0) -> Any:
    return SimpleNamespace(
        header=header("imu", stamp_ns), orientation=quaternion(rotation), orientation_covariance=[variance] * 9
    )


def same(one: Any, other: Rotation) -> bool:
    return bool((Rotation.from_quat(one) * other.inv()).magnitude() < 1e-12)


def test_a_chain_of_moving_and_static_transforms_is_composed_up_to_the_base() -> None:
    tree = TransformTree()
    world, base, wrist, tool = rotations(4)
    tree.add(transform("world", "base", world), 0.0, static=True)
    tree.add(transform("base", "wrist", base), 10.0, static=False)
    tree.add(transform("wrist", "flange", wrist), 10.1, static=False)
    tree.add(transform("flange", "tool0", tool), 0.0, static=True)
    assert same(tree.orientation("base", "tool0", 10.2), base * wrist * tool)
    assert same(tree.orientation("world", "tool0", 10.2), world * base * wrist * tool)
    assert same(tree.orientation("tool0", "tool0", 10.2), Rotation.identity())


def test_an_orientation_of_transforms_that_are_old_or_repeat_one_stamp_is_not_known() -> None:
    tree = TransformTree()
    first, second = rotations(2)
    tree.add(transform("base", "hand", first, stamp_ns=5), 10.0, static=False)
    tree.add(transform("base", "hand", second, stamp_ns=5), 10.2, static=False)
    assert same(tree.orientation("base", "hand", 9.99 + STALE_S), first)
    with pytest.raises(OrientationUnknown, match=r"from 'base' to 'hand' is older than 0\.3 s, or repeats"):
        tree.orientation("base", "hand", 10.01 + STALE_S)
    tree.add(transform("base", "hand", second, stamp_ns=6), 11.0, static=False)
    assert same(tree.orientation("base", "hand", 11.0), second)


def test_a_path_that_is_missing_is_named() -> None:
    tree = TransformTree()
    with pytest.raises(OrientationUnknown, match="from 'hand' up to 'base': none has the child 'hand'"):
        tree.orientation("base", "hand", 0.0)
    tree.add(transform("wrist", "hand", Rotation.identity()), 0.0, static=True)
    with pytest.raises(OrientationUnknown, match="the topmost frame is 'wrist'"):
        tree.orientation("base", "hand", 0.0)
    tree.add(transform("hand", "wrist", Rotation.identity()), 0.0, static=True)
    with pytest.raises(OrientationUnknown, match="form a ring"):
        tree.orientation("base", "hand", 0.0)


@pytest.mark.parametrize("bad", [(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.05), (float("nan"), 0.0, 0.0, 1.0)])
def test_a_rotation_that_is_no_unit_quaternion_is_refused_and_the_one_before_stays(bad: tuple[float, ...]) -> None:
    tree = TransformTree()
    tree.add(transform("base", "hand", Rotation.identity(), 1), 1.0, static=False)
    wrong = transform("base", "hand", Rotation.identity(), 2)
    wrong.transform.rotation = SimpleNamespace(**dict(zip("xyzw", bad, strict=True)))
    with pytest.raises(OrientationUnknown, match="the transform from 'base' to 'hand' must be a unit quaternion"):
        tree.add(wrong, 1.1, static=False)
    assert same(tree.orientation("base", "hand", 1.2), Rotation.identity())
    reading = imu(Rotation.identity())
    reading.orientation = wrong.transform.rotation
    with pytest.raises(OrientationUnknown, match="the orientation of /imu must be a unit quaternion"):
        ImuOrientation("/imu").add(reading, 0.0)


def test_an_imu_gives_the_orientation_of_the_gripper_it_is_mounted_on() -> None:
    gripper, mount = rotations(2)
    source = ImuOrientation("/imu", tuple(mount.as_quat()))
    with pytest.raises(OrientationUnknown, match="no message has come on /imu"):
        source.orientation(0.0)
    source.add(imu(gripper * mount, 1), 5.0)
    assert same(source.orientation(4.99 + STALE_S), gripper)
    source.add(imu(gripper, 1), 5.2)
    with pytest.raises(OrientationUnknown, match=r"/imu is silent for more than 0\.3 s, or repeats one stamp"):
        source.orientation(5.01 + STALE_S)
    with pytest.raises(OrientationUnknown, match=r"/imu has no orientation \(orientation_covariance\[0\] is -1\)"):
        source.add(imu(gripper, 2, variance=-1.0), 6.0)


def test_gravity_in_the_pads_points_down_in_the_world() -> None:
    gripper = rotations(1)[0]
    for finger, gravity_mps2 in pad_gravities(tuple(gripper.as_quat()), PADS).items():
        in_world = (gripper * Rotation.from_quat(PADS[finger])).apply(gravity_mps2)
        assert in_world == pytest.approx(DOWN_MPS2, abs=1e-9)
