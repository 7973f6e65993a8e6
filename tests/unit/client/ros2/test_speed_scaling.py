"""The speed scale as a trajectory controller subscribes to it: "transient local", of the type of control_msgs."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest
from ros_peers import typestore

pytest.importorskip("cyclonedds", reason="needs cyclonedds, the extra `ros2`")

from ros_graph import free_domain, joined, reader

from slipd_client.motion import MotionAdvisorBase
from slipd_client.ros2.dds import RosPublisher
from slipd_client.ros2.speed_scaling import SpeedScaling

TOPIC = "/joint_trajectory_controller/speed_scaling_input"
STORE = typestore()


class Advisor(MotionAdvisorBase):
    """Advice that the test sets."""

    def __init__(self) -> None:
        self.scale: float | None = None

    def speed_scale(self, floor: float | None = None) -> float | None:
        return floor if self.scale is None else self.scale


def factors(controller: Any) -> Iterator[float]:
    """Yield the factors that arrive at a controller, for ever."""
    until_s = time.monotonic() + 40
    while time.monotonic() < until_s:
        for sample in controller.take(20):
            if sample.sample_info.valid_data:
                yield STORE.deserialize_cdr(sample.data, "control_msgs/msg/SpeedScalingFactor").factor
        time.sleep(0.01)


def test_a_controller_receives_the_scale_and_is_left_with_the_floor() -> None:
    with joined(free_domain()) as participant:
        advisor = Advisor()
        speed = SpeedScaling(RosPublisher(participant, {TOPIC: 1}).publish, TOPIC, advisor, 0.2)
        speed.start()
        arrived = factors(reader(participant, TOPIC, "control_msgs/SpeedScalingFactor", latched=True))
        assert next(arrived) == 0.2, "it is not known yet"
        advisor.scale = 0.7
        assert next(factor for factor in arrived if factor != 0.2) == 0.7
        speed.stop()
        late = factors(reader(participant, TOPIC, "control_msgs/SpeedScalingFactor", latched=True))
        assert next(late) == 0.2, "a controller that comes late gets the last factor"
