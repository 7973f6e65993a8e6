"""What the grip holds, for ROS: a speed scale for controllers, and answers to planned motions of the gripper.

The scale is that of trajectory controllers of ``ros2_control``, ``control_msgs/SpeedScalingFactor``. A plan is a
``trajectory_msgs/MultiDOFJointTrajectory``: poses of the gripper in a frame whose Z points up, with or without
velocities and accelerations. Its answer says whether the grip holds it, and how far it must slow down.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

from cyclonedds.sub import DataReader

from slipd_client.errors import SlipdClientError
from slipd_client.messages.replies import MotionReply
from slipd_client.messages.request_fields import MOST_POINTS
from slipd_client.motion import MotionAdvisorBase, point_of
from slipd_client.ros.arm_motion import POSE_SPAN_S, PoseMotion
from slipd_client.ros.conversion import RosMessage
from slipd_client.ros.dds import taken
from slipd_client.ros.feeds import Background
from slipd_client.ros.orientation import OrientationUnknown, Pose, unit, vector
from slipd_client.ros.slipd_types import CHECKED, motion_check

PERIOD_S = 0.05
"""Time between two messages, s: half of that between two messages of slipd, so that stale advice ends soon."""


class SpeedScaling(Background):
    """Publishes the scale, and the floor while the scale is not known.

    A controller keeps the last factor that it received. So the end of this thread leaves the floor in force.

    Args:
        publish: Sends a ROS message.
        topic: Topic of the controller: its name and ``speed_scaling_input``.
        advisor: Receives the advice, in this thread alone.
        floor: 0 to less than 1; 0 pauses the arm while the scale is not known.
    """

    def __init__(
        self, publish: Callable[[RosMessage], None], topic: str, advisor: MotionAdvisorBase, floor: float
    ) -> None:
        super().__init__("speed scaling")
        self._publish, self._topic, self._advisor, self._floor = publish, topic, advisor, floor

    def run(self) -> None:
        """Publish until `stop`."""
        try:
            while not self._ended.wait(PERIOD_S):
                scale = self._advisor.speed_scale(self._floor)
                self._send(self._floor if scale is None else scale)
        finally:
            self._send(self._floor)

    def _send(self, factor: float) -> None:
        self._publish(RosMessage(self._topic, "control_msgs/SpeedScalingFactor", {"factor": factor}))


PLAN = "trajectory_msgs/MultiDOFJointTrajectory"
LOOK_S = 0.02
"""Time between two looks for plans, s."""


class PlanCheck(Background):
    """Answers each plan with a `slipd_msgs/MotionCheck` that has the header of the plan.

    Args:
        reader: Receives the plans.
        publish: Sends a ROS message.
        topic: Topic of the answers.
        check: Asks the daemon about points, from this thread alone.
        base: Frame of the plans, whose Z points up.
        hand: Frame of the robot that is the gripper's frame.
    """

    def __init__(
        self,
        reader: DataReader[Any],
        publish: Callable[[RosMessage], None],
        topic: str,
        check: Callable[[list[list[float]]], MotionReply],
        base: str,
        hand: str,
    ) -> None:
        super().__init__("check of planned motions")
        self._reader, self._publish, self._topic, self._check = reader, publish, topic, check
        self._base, self._hand = base, hand

    def run(self) -> None:
        """Answer until `stop`."""
        while not self._ended.wait(LOOK_S):
            for plan in taken(self._reader):
                stamp = {"sec": plan.header.stamp.sec, "nanosec": plan.header.stamp.nanosec}
                header = {"stamp": stamp, "frame_id": plan.header.frame_id}
                self._publish(RosMessage(self._topic, CHECKED, motion_check(header, self._answer(plan))))

    def _answer(self, plan: Any) -> Mapping[str, Any]:
        try:
            return self._check(points_of(plan, self._base, self._hand))
        except (PlanError, SlipdClientError) as error:
            return {"unknown": str(error)}


SPAN_NS = round(POSE_SPAN_S * 1e9)
LONGEST_STEP_NS = SPAN_NS // 2
"""Longest time between poses from which the motion is derived: three of them span the filter."""

NS = 1_000_000_000


class PlanError(ValueError):
    """A plan that cannot be checked; the text says what is wrong and what would be right."""


def points_of(plan: Any, base: str, hand: str) -> list[list[float]]:
    """Return the points of a plan, as `slipd_client.motion.point_of` makes them.

    Velocities and accelerations of the plan are used where every point has them. Else they are derived from the poses
    with the filter of the arm stream, and the plan counts as at rest before its first pose and after its last.

    Args:
        plan: The message; its ``joint_names`` are frames.
        base: Frame of its poses: it stands still, and its Z points up.
        hand: Frame that is the gripper's frame. Where the plan has one frame only, it is that, whatever its name.

    Raises:
        PlanError: The plan is of another frame, has fewer than two points or more than `MOST_POINTS`, times that do
            not rise, a rotation that is no unit quaternion, or poses too far apart to derive the motion.
    """
    if plan.header.frame_id != base:
        raise PlanError(f"the poses must be in {base!r}, whose Z points up, got {plan.header.frame_id!r}")
    if len(plan.joint_names) != 1 and hand not in plan.joint_names:
        raise PlanError(f"joint_names must have {hand!r}, got {', '.join(plan.joint_names) or 'none'}")
    index = plan.joint_names.index(hand) if hand in plan.joint_names else 0
    times_ns = [point.time_from_start.sec * NS + point.time_from_start.nanosec for point in plan.points]
    steps_ns = [after - before for before, after in pairwise(times_ns)]
    if not steps_ns or min(steps_ns) <= 0:
        raise PlanError("a plan must have at least two points, at rising times")
    if len(times_ns) > MOST_POINTS:
        raise PlanError(f"a plan must have at most {MOST_POINTS:,} points, got {len(times_ns):,}: leave some out")
    try:
        poses = [_pose(t_ns, point.transforms[index]) for t_ns, point in zip(times_ns, plan.points, strict=True)]
        if all(point.velocities and point.accelerations for point in plan.points):
            return [_stated(pose, point, index) for pose, point in zip(poses, plan.points, strict=True)]
    except IndexError:
        raise PlanError("every point must have a transform, velocity and acceleration for each frame") from None
    if max(steps_ns) > LONGEST_STEP_NS:
        raise PlanError(
            f"poses without velocities and accelerations must be at most {LONGEST_STEP_NS / 1e6:g} ms apart, "
            f"got {max(steps_ns) / 1e6:g} ms"
        )
    return _derived(poses)


def _pose(t_ns: int, transform: Any) -> Pose:
    try:
        rotation = unit(transform.rotation, f"the rotation at {t_ns / 1e9:g} s")
    except OrientationUnknown as error:
        raise PlanError(str(error)) from None
    return Pose(t_ns, vector(transform.translation), rotation)


def _stated(pose: Pose, point: Any, index: int) -> list[float]:
    velocity, acceleration = point.velocities[index], point.accelerations[index]
    turns = vector(velocity.angular), vector(acceleration.angular)
    return point_of(pose.stamp_ns / NS, pose.rotation, vector(acceleration.linear), *turns)


def _derived(poses: list[Pose]) -> list[list[float]]:
    first, last = poses[0], poses[-1]
    ahead, rest_ns = SPAN_NS // LONGEST_STEP_NS, range(0, SPAN_NS + 1, LONGEST_STEP_NS)
    begin = [first._replace(stamp_ns=first.stamp_ns + t_ns - SPAN_NS) for t_ns in rest_ns[:ahead]]
    end = [last._replace(stamp_ns=last.stamp_ns + t_ns) for t_ns in rest_ns[1:]]
    motion = PoseMotion()
    readings = filter(None, map(motion.add, (*begin, *poses, *end)))
    return [[one.stamp_ns / NS, *(each for vector_ in one[1:] for each in vector_)] for one in readings]
