"""ROS 2 node that sends slipd the arm's orientation by the transforms; ``slipctl serve ros2`` does it without ROS.

``python3 orientation_node.py --ros-args -p base:=base_link -p hand:=tool0 -p pads.left:="[0.5, -0.5, 0.5, 0.5]"``.
``hand`` is the robot's frame at the gripper's frame of slipd's config; ``pads.FINGER`` the ``quat_xyzw`` of
``[grasp.pads.FINGER]`` there. Needs rclpy and tf2_msgs (ROS 2 Humble or newer) and slipd_client.
"""

from __future__ import annotations

import functools
import time

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from tf2_msgs.msg import TFMessage

from slipd_client.errors import ClientError
from slipd_client.gravity_feed import PERIOD_S
from slipd_client.grip import GripClient
from slipd_client.ros2.orientation import OrientationUnknown, TransformTree, pad_gravities, unit_of

MUTED_S = 5.0
"""Time between two lines of the log about the same trouble."""


class OrientationNode(Node):
    """Sends gravity in the frame of each pad at 10 Hz, while the orientation is known."""

    def __init__(self, client: GripClient) -> None:
        super().__init__("slipd_orientation", automatically_declare_parameters_from_overrides=True)
        self._client = client
        self._tree = TransformTree()
        self._base, self._hand = self._text("base"), self._text("hand")
        pads = self.get_parameters_by_prefix("pads")
        if not pads:
            raise SystemExit("pads.FINGER must be the quat_xyzw of each pad, e.g. -p pads.left:='[0.5,-0.5,0.5,0.5]'")
        self._pads = {finger: unit_of(pad.value, f"pads.{finger}") for finger, pad in pads.items()}
        latched = QoSProfile(
            depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
        )
        moving = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.create_subscription(TFMessage, "/tf_static", functools.partial(self._note, static=True), latched)
        self.create_subscription(TFMessage, "/tf", functools.partial(self._note, static=False), moving)
        self.create_timer(PERIOD_S, self._send)

    def _text(self, name: str) -> str:
        if not self.has_parameter(name):
            raise SystemExit(f"{name} must name a frame: --ros-args -p {name}:=FRAME")
        return str(self.get_parameter(name).value)

    def _note(self, message: TFMessage, *, static: bool) -> None:
        for transform in message.transforms:
            try:
                self._tree.add(transform, time.monotonic(), static=static)
            except OrientationUnknown as error:
                self.get_logger().warning(str(error), throttle_duration_sec=MUTED_S)

    def _send(self) -> None:
        try:
            gripper = self._tree.orientation(self._base, self._hand, time.monotonic())
            for finger, gravity_mps2 in pad_gravities(gripper, self._pads).items():
                self._client.gravity_set(finger, gravity_mps2)
        except (OrientationUnknown, ClientError) as error:
            self.get_logger().warning(f"no orientation is sent: {error}", throttle_duration_sec=MUTED_S)


def main() -> None:
    """Run the node until interrupted."""
    rclpy.init()
    try:
        with GripClient() as client:
            rclpy.spin(OrientationNode(client))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
