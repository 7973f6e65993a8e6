"""The speed scale of slipd for trajectory controllers of ``ros2_control``: ``control_msgs/SpeedScalingFactor``."""

from __future__ import annotations

from collections.abc import Callable

from slipd_client.motion import MotionAdvisorBase
from slipd_client.ros.conversion import RosMessage
from slipd_client.ros2.background import Background

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
