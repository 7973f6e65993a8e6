"""Sources of the orientation, beside publishers that come and go."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

pytest.importorskip("cyclonedds", reason="needs cyclonedds, the extra `ros2`")

from cyclonedds.domain import DomainParticipant
from ros_graph import free_domain, joined

from slipd_client.grip import GripClient
from slipd_client.ros.conversion import RosMessage
from slipd_client.ros2.dds import RosPublisher
from slipd_client.ros2.orientation import IDENTITY, Quaternion
from slipd_client.ros2.orientation_feed import ImuSource, OrientationFeed

if TYPE_CHECKING:
    from conftest import Daemon

PATIENCE_S = 40.0
TILTED: Quaternion = (0.6, 0.0, 0.0, 0.8)


def imu(sec: int, orientation: Quaternion) -> RosMessage:
    zero, unknown = dict.fromkeys("xyz", 0.0), [0.0] * 9
    value = {
        "header": {"stamp": {"sec": sec, "nanosec": 0}, "frame_id": "imu"},
        "orientation": dict(zip("xyzw", orientation, strict=True)),
        "orientation_covariance": unknown,
        "angular_velocity": zero,
        "angular_velocity_covariance": unknown,
        "linear_acceleration": zero,
        "linear_acceleration_covariance": unknown,
    }
    return RosMessage("/imu", "sensor_msgs/Imu", value)


def wait_until(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s, "it never came"
        time.sleep(0.01)


def publish_once(participant: DomainParticipant, source: ImuSource, message: RosMessage) -> None:
    """Publish a message, wait until it has arrived, and end the publisher."""
    publisher = RosPublisher(participant, {"/imu": 1})
    publisher.publish(message)
    wait_until(lambda: bool(source._reader.read()))
    del publisher
    wait_until(lambda: not source._reader.get_matched_publications())


def test_an_imu_that_is_restarted_is_used_again() -> None:
    with joined(free_domain()) as participant:
        source = ImuSource(participant, "/imu", IDENTITY)
        for sec, orientation in ((1, IDENTITY), (2, TILTED)):
            publish_once(participant, source, imu(sec, orientation))
            assert source.orientation(now_s=float(sec)) == pytest.approx(orientation)
            assert source.orientation(now_s=float(sec)) == pytest.approx(orientation)


class OnceUndecodable:
    """A source whose first message cannot be decoded."""

    def __init__(self) -> None:
        self.asked = 0

    def orientation(self, now_s: float) -> Quaternion:
        self.asked += 1
        if self.asked == 1:
            raise ValueError("'utf-8' codec can't decode byte 0xff")
        return IDENTITY


def test_a_message_that_cannot_be_decoded_does_not_end_the_feed(daemon: Daemon) -> None:
    with GripClient(daemon.endpoint) as client:
        feed = OrientationFeed(client, OnceUndecodable(), {"left": IDENTITY})
        feed.start()
        wait_until(lambda: any(each["op"] == "gravity.set" for each in daemon.requests))
        feed.stop()
