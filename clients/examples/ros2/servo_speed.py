"""ROS 2 node between a teleoperation or a controller and MoveIt Servo: slows its twists to what the grip holds.

``python3 servo_speed.py --ros-args -r twist_in:=/teleop/twist -r twist_out:=/servo_node/delta_twist_cmds``. Needs
rclpy and geometry_msgs (ROS 2 Humble or newer) and slipd_client. Servo stops by itself where no twist arrives.
"""

from __future__ import annotations

import contextlib
import time

import rclpy
from geometry_msgs.msg import TwistStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from slipd_client.motion import MotionAdvisor

RISE_PER_S = 0.5
"""How fast the scale may rise: the arm speeds up over two seconds, and slows down at once."""


class ServoSpeed(Node):
    """Multiplies every twist by the scale; ``floor`` is the scale while slipd does not know what holds."""

    def __init__(self, advisor: MotionAdvisor) -> None:
        super().__init__("slipd_servo_speed")
        self._advisor = advisor
        self._floor = float(self.declare_parameter("floor", 0.2).value)
        self._scale, self._since_s = self._floor, time.monotonic()
        self._out = self.create_publisher(TwistStamped, "twist_out", 10)
        self.create_subscription(TwistStamped, "twist_in", self._slow, 10)

    def _slow(self, command: TwistStamped) -> None:
        now_s = time.monotonic()
        scale = self._advisor.speed_scale(self._floor) or 0.0
        self._scale = min(scale, self._scale + RISE_PER_S * (now_s - self._since_s))
        self._since_s = now_s
        for vector in (command.twist.linear, command.twist.angular):
            vector.x *= self._scale
            vector.y *= self._scale
            vector.z *= self._scale
        if self._advisor.why_unknown:
            self.get_logger().warning(f"at the floor: {self._advisor.why_unknown}", throttle_duration_sec=5.0)
        self._out.publish(command)


def main() -> None:
    """Run the node until interrupted."""
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException), MotionAdvisor() as advisor:
        rclpy.spin(ServoSpeed(advisor))


if __name__ == "__main__":
    main()
