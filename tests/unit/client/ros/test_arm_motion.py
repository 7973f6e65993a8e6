"""Motion and orientation of the gripper from poses, transforms and an IMU, judged by SciPy and a known motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import ros_values
from numpy.typing import NDArray
from ros_values import attributes, numbers
from scipy.spatial.transform import Rotation

from slipd_client.quaternions import of_rotation_vector, rotation_vector
from slipd_client.ros.arm_motion import (
    IMU_SPAN_S,
    POSE_SPAN_S,
    ArmReading,
    ImuMotion,
    PoseMotion,
    clock_offset_ns,
)
from slipd_client.ros.orientation import (
    STALE_S,
    ImuOrientation,
    OrientationUnknown,
    Pose,
    TransformTree,
)

Vector = NDArray[np.float64]
DOWN_MPS2 = np.array([0.0, 0.0, -9.80665])
BEGIN_NS = 1_700_000_000_000_000_000
MOUNT, PLACE_M = Rotation.random(random_state=5), (0.05, -0.02, 0.08)


class Swing:
    """A gripper on a swinging arm: 6 m/s² and 5 rad/s about an axis that itself turns."""

    def position(self, t_s: float) -> Vector:
        return np.array([0.1 * math.sin(7 * t_s), 0.05 * math.cos(9 * t_s), 0.04 * math.sin(5 * t_s)])

    def rotation(self, t_s: float) -> Rotation:
        return Rotation.from_rotvec([0, 0, 3 * t_s]) * Rotation.from_rotvec([math.sin(4 * t_s), 0.3, 0])

    def second(self, t_s: float) -> Vector:
        step = 1e-4
        return (self.position(t_s + step) - 2 * self.position(t_s) + self.position(t_s - step)) / step**2

    def turn(self, t_s: float) -> Vector:
        """Return the angular velocity in the frame of the gripper."""
        step = 1e-5
        before, after = self.rotation(t_s - step), self.rotation(t_s + step)
        return np.asarray((before.inv() * after).as_rotvec() / (2 * step))

    def truth(self, t_s: float) -> tuple[Vector, Vector, Vector]:
        """Return what a reading of that time should be."""
        felt = self.rotation(t_s).inv().apply(DOWN_MPS2 - self.second(t_s))
        return felt, self.turn(t_s), (self.turn(t_s + 1e-4) - self.turn(t_s - 1e-4)) / 2e-4

    def pose(self, t_s: float) -> Pose:
        x, y, z = self.position(t_s).tolist()
        return Pose(BEGIN_NS + round(t_s * 1e9), (x, y, z), tuple(self.rotation(t_s).as_quat().tolist()))

    def imu(self, t_s: float) -> Any:
        """Return the message of an IMU at PLACE_M, turned by MOUNT."""
        felt, turn, spin = self.truth(t_s)
        force = -felt + np.cross(spin, PLACE_M) + np.cross(turn, np.cross(turn, PLACE_M))
        return imu_message(BEGIN_NS + round(t_s * 1e9), MOUNT.inv().apply(force), MOUNT.inv().apply(turn))


def transform(parent: str, child: str, rotation: Rotation, stamp_ns: int = 1, at_m: Any = (0.0, 0.0, 0.0)) -> Any:
    return attributes(ros_values.transform(stamp_ns, parent, child, rotation.as_quat(), at_m))


def imu_message(stamp_ns: int, *vectors: Any, **values: Any) -> Any:
    return attributes(ros_values.imu(stamp_ns, *vectors, **values))


def check(reading: ArmReading | None, sent_s: float, span_s: float, within: tuple[float, float, float]) -> None:
    """Compare a reading with the truth of its time, which is half a span before it was sent."""
    at_s = (reading.stamp_ns - BEGIN_NS) * 1e-9
    assert sent_s - at_s == pytest.approx(span_s / 2, abs=span_s / 8)
    for value, truth, limit in zip(reading[1:], Swing().truth(at_s), within, strict=True):
        assert value == pytest.approx(truth, abs=limit)


def test_poses_and_an_imu_give_the_motion_of_half_a_span_ago() -> None:
    poses, imu = PoseMotion(), ImuMotion("/imu", tuple(MOUNT.as_quat()), PLACE_M)
    times = [0.004 * i + 0.0002 * (i % 3) for i in range(80)]
    for t_s in times:
        by_pose, by_imu = poses.add(Swing().pose(t_s)), imu.add(Swing().imu(t_s))
        if t_s > POSE_SPAN_S:
            check(by_pose, t_s, POSE_SPAN_S, (0.15, 0.02, 0.5))
            check(by_imu, t_s, IMU_SPAN_S, (0.15, 0.02, 0.5))


def test_after_a_pause_or_a_clock_set_back_the_span_is_filled_again_and_close_readings_are_left_out() -> None:
    motion = PoseMotion()
    assert [motion.add(Swing().pose(0.004 * i)) is not None for i in range(20)] == [False] * 5 + [True] * 15
    for why, t_s in (("closer than a sixteenth of the span", 0.077), ("a pause", 0.5), ("set back", 0.1)):
        assert motion.add(Swing().pose(t_s)) is None, why
    again = [motion.add(Swing().pose(0.1 + 0.02 * i)) is not None for i in range(1, 4)]
    assert again == [False, True, True], "three readings are enough"


def test_two_readings_of_an_imu_are_enough_and_one_without_a_quantity_is_refused() -> None:
    motion = ImuMotion("/imu", (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    up, turn = np.array([0.0, 0.0, 9.80665]), np.array([0.0, 1.0, 0.0])
    assert motion.add(imu_message(BEGIN_NS, up, 0 * turn)) is None
    reading = motion.add(imu_message(BEGIN_NS + 20_000_000, up, turn))
    assert reading.gravity_mps2 == pytest.approx(DOWN_MPS2)
    assert reading.angular_acceleration_radps2 == pytest.approx([0.0, 50.0, 0.0])
    with pytest.raises(OrientationUnknown, match=r"/imu has no angular_velocity \(angular_velocity_covariance"):
        motion.add(imu_message(BEGIN_NS, up, turn, unknown="angular_velocity"))


def test_stamps_of_another_clock_are_refused() -> None:
    assert clock_offset_ns(10**18 - 5_000_000, 10**18, 7) == 7 - 10**18
    for behind_s in (-0.03, 0.3, 1.7e9):
        with pytest.raises(OrientationUnknown, match="behind this machine's clock: synchronise the clocks"):
            clock_offset_ns(10**18 - round(behind_s * 1e9), 10**18, 7)


def test_a_chain_of_transforms_is_composed_and_a_pose_needs_moving_ones_of_one_time() -> None:
    tree = TransformTree()
    world, base, tool = Rotation.random(3, random_state=8)
    tree.add(transform("base", "wrist", base, 7, (1.0, 0.0, 0.5)), 0.0, static=False)
    tree.add(transform("wrist", "tool0", tool, 0, (0.0, 0.2, 0.0)), 0.0, static=True)
    pose = tree.pose("base", "tool0", 0.1)
    place_m = pytest.approx(np.array([1.0, 0.0, 0.5]) + base.apply([0.0, 0.2, 0.0]))
    assert (pose.stamp_ns, pose.position_m, same(pose.rotation, base * tool)) == (7, place_m, True)
    tree.add(transform("world", "base", world, 6), 0.0, static=False)
    assert same(tree.orientation("world", "tool0", 0.2), world * base * tool)
    assert same(tree.orientation("tool0", "tool0", 0.2), Rotation.identity())
    for frames, count in ((("world", "tool0"), 2), (("wrist", "tool0"), 0)):
        with pytest.raises(OrientationUnknown, match=f"must move and have one stamp, got {count}"):
            tree.pose(*frames, 0.1)


@pytest.mark.parametrize("angle", [0.0, 1e-14, 0.3, 3.1, -2.0])
def test_rotation_vectors_are_those_of_scipy(angle: float) -> None:
    turn = (0.6 * angle, 0.0, -0.8 * angle)
    for sign in (1, -1):
        quaternion = sign * Rotation.from_rotvec(turn).as_quat()
        assert rotation_vector(tuple(quaternion.tolist())) == pytest.approx(turn, abs=1e-12)
    assert Rotation.from_quat(of_rotation_vector(turn)).as_rotvec() == pytest.approx(turn, abs=1e-12)


def same(one: Any, other: Rotation) -> bool:
    return bool((Rotation.from_quat(one) * other.inv()).magnitude() < 1e-12)


def test_an_orientation_of_transforms_that_are_old_or_repeat_one_stamp_is_not_known() -> None:
    tree = TransformTree()
    first, second = Rotation.random(2, random_state=7)
    tree.add(transform("base", "hand", first, stamp_ns=5), 10.0, static=False)
    tree.add(transform("base", "hand", second, stamp_ns=5), 10.2, static=False)
    assert same(tree.orientation("base", "hand", 9.99 + STALE_S), first)
    with pytest.raises(OrientationUnknown, match=r"from 'base' to 'hand' is older than 0\.3 s, or repeats"):
        tree.orientation("base", "hand", 10.01 + STALE_S)
    tree.add(transform("base", "hand", second, stamp_ns=6), 11.0, static=False)
    assert same(tree.orientation("base", "hand", 11.0), second)


def test_a_path_that_is_missing_is_named() -> None:
    tree = TransformTree()
    for why, parent, child in (
        ("from 'hand' up to 'base': none has the child 'hand'", "wrist", "hand"),
        ("the topmost frame is 'wrist'", "hand", "wrist"),
        ("form a ring", "", ""),
    ):
        with pytest.raises(OrientationUnknown, match=why):
            tree.orientation("base", "hand", 0.0)
        tree.add(transform(parent, child, Rotation.identity()), 0.0, static=True)


@pytest.mark.parametrize("bad", [(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.05), (float("nan"), 0.0, 0.0, 1.0)])
def test_a_rotation_that_is_no_unit_quaternion_is_refused_and_the_one_before_stays(bad: tuple[float, ...]) -> None:
    tree = TransformTree()
    tree.add(transform("base", "hand", Rotation.identity(), 1), 1.0, static=False)
    wrong = transform("base", "hand", Rotation.identity(), 2)
    wrong.transform.rotation = attributes(numbers(bad, "xyzw"))
    with pytest.raises(OrientationUnknown, match="the transform from 'base' to 'hand' must be a unit quaternion"):
        tree.add(wrong, 1.1, static=False)
    assert same(tree.orientation("base", "hand", 1.2), Rotation.identity())
    with pytest.raises(OrientationUnknown, match="the orientation of /imu must be a unit quaternion"):
        ImuOrientation("/imu").add(imu_message(1, orientation=bad), 0.0)


def test_an_imu_gives_the_orientation_of_the_gripper_it_is_mounted_on() -> None:
    gripper, mount = Rotation.random(2, random_state=7)
    source = ImuOrientation("/imu", tuple(mount.as_quat()))
    with pytest.raises(OrientationUnknown, match="no message has come on /imu"):
        source.orientation(0.0)
    source.add(imu_message(1, orientation=(gripper * mount).as_quat()), 5.0)
    assert same(source.orientation(4.99 + STALE_S), gripper)
    source.add(imu_message(1, orientation=gripper.as_quat()), 5.2)
    with pytest.raises(OrientationUnknown, match=r"/imu is silent for more than 0\.3 s, or repeats one stamp"):
        source.orientation(5.01 + STALE_S)
    with pytest.raises(OrientationUnknown, match=r"/imu has no orientation \(orientation_covariance\[0\] is -1\)"):
        source.add(imu_message(2, unknown="orientation"), 6.0)
