"""Answers planned motions that ROS nodes publish: does the grip hold them, and how far must they slow down?"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from cyclonedds.sub import DataReader

from slipd_client.errors import SlipdClientError
from slipd_client.messages.schema.replies import MotionReply
from slipd_client.ros.conversion import RosMessage
from slipd_client.ros.slipd_types import CHECKED, motion_check
from slipd_client.ros2.arm_sources import taken
from slipd_client.ros2.background import Background
from slipd_client.ros2.planned_motion import PlanError, points_of

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
