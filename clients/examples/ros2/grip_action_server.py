"""A ROS 2 node: the action ``control_msgs/action/ParallelGripperCommand``, carried out by slipd under its rules.

``ros2 run`` is not needed: ``python3 grip_action_server.py --ros-args -p joint:=gripper_joint -r
gripper_cmd:=/gripper_controller/gripper_cmd``. Needs rclpy and control_msgs (ROS 2 Jazzy or newer) and slipd_client.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Mapping
from typing import Any

import rclpy
from control_msgs.action import ParallelGripperCommand
from grip_goals import GoalError, Joint, carry_out, joint_state
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState

from slipd_client.grip import GripClient
from slipd_client.subscriber import Subscriber


class GripActionServer(Node):
    """Carries out one goal at a time; another one is rejected meanwhile."""

    def __init__(self) -> None:
        super().__init__("slipd_gripper")
        default_force_n = self._parameter("default_force", 0.0)
        self._joint = Joint(
            self._parameter("joint", "gripper_joint"),
            self._parameter("width_per_position", 1.0),
            self._parameter("width_at_zero", 0.0),
            default_force_n or None,
            self._parameter("tolerance", 0.001),
        )
        self._publish = self._parameter("publish", "") or None
        self._requests = self._parameter("requests", "") or None
        self._busy = threading.Lock()
        self._server = ActionServer(
            self,
            ParallelGripperCommand,
            "gripper_cmd",
            execute_callback=self._execute,
            goal_callback=self._accept,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )

    def _parameter(self, name: str, default: Any) -> Any:
        return self.declare_parameter(name, default).value

    def _accept(self, _: Any) -> GoalResponse:
        """Accept a goal if none is being carried out; `_execute` then frees the gripper for the next one."""
        return GoalResponse.ACCEPT if self._busy.acquire(blocking=False) else GoalResponse.REJECT

    def _execute(self, handle: Any) -> ParallelGripperCommand.Result:
        try:
            return self._carry_out(handle)
        finally:
            self._busy.release()

    def _carry_out(self, handle: Any) -> ParallelGripperCommand.Result:
        result = ParallelGripperCommand.Result()
        with GripClient(self._requests) as client, Subscriber(self._publish, ("gripper",)) as messages:
            try:
                outcome, state = carry_out(
                    client,
                    messages,
                    handle.request.command,
                    self._joint,
                    cancelled=lambda: handle.is_cancel_requested,
                    feedback=lambda state: handle.publish_feedback(
                        ParallelGripperCommand.Feedback(state=self._state(state))
                    ),
                )
            except GoalError as error:
                self.get_logger().error(str(error))
                handle.abort()
                return result
        if state:
            result.state = self._state(state)
        if outcome is None:
            handle.canceled()
            return result
        result.stalled, result.reached_goal = outcome
        handle.succeed()
        return result

    def _state(self, gripper: Mapping[str, Any]) -> JointState:
        state = JointState(**joint_state(gripper, self._joint))
        state.header.stamp = self.get_clock().now().to_msg()
        return state


def main() -> None:
    """Run the node until interrupted."""
    rclpy.init()
    executor = MultiThreadedExecutor()  # a goal is cancelled while it is carried out
    executor.add_node(GripActionServer())
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        executor.spin()


if __name__ == "__main__":
    main()
