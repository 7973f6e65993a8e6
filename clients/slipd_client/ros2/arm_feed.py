"""Pushes the arm's motion that ROS nodes publish to the daemon, as the stream ``[grasp.arm]`` of its config."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, Union

import zmq
from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.util import duration

from slipd_client.errors import CallError
from slipd_client.messages.codec import encode
from slipd_client.messages.names import Health
from slipd_client.ros2.arm_stream import (
    IMU_SPAN_S,
    POSE_SPAN_S,
    ArmReading,
    ImuMotion,
    PoseMotion,
    clock_offset_ns,
    stamp_of,
)
from slipd_client.ros2.orientation import STALE_S, OrientationUnknown, Quaternion, TransformTree, Vector
from slipd_client.ros2.orientation_feed import RosFeed, ros_reader, taken

LOOK_S = 0.05
"""Longest wait for a message before the feed checks whether it has ended, s."""

QUEUE = 50
"""Readings that wait for a daemon that is busy; those of a daemon that is not there are dropped."""


class ArmPort(NamedTuple):
    """Where the readings go.

    Attributes:
        endpoint: ``port`` of ``[grasp.arm]``.
        sensor: ``sensor`` of it.
    """

    endpoint: str
    sensor: str


def arm_port(config: Mapping[str, Any], span_s: float) -> ArmPort | None:
    """Return where the readings go; None where the config has no ``[grasp.arm]`` that programs push.

    Args:
        config: Tables of the daemon's config.
        span_s: Span of the filter.

    Raises:
        CallError: The table is wrong, or readings would be stale by the delay of the filter.
    """
    arm = config["grasp"].get("arm")
    if arm is None or arm.get("device") != "external":
        return None
    try:
        rate_hz, port = float(arm["rate_hz"]), ArmPort(str(arm["port"]), str(arm["sensor"]))
        stale_s = float(arm.get("stale_s", max(3.0 / rate_hz, 0.02)))
    except (KeyError, TypeError, ValueError, ZeroDivisionError) as error:
        raise CallError("[grasp.arm] must have port, sensor and rate_hz; check it: slipd check") from error
    if stale_s < span_s:
        raise CallError(
            f"stale_s of [grasp.arm] must be at least {span_s:g}, got {stale_s:g}: the filter of the acceleration "
            f"delays the readings by {span_s / 2:g} s"
        )
    return port


class TransformMotion:
    """The motion by ``/tf`` and ``/tf_static``.

    Args:
        participant: Of the domain.
        topic: Topic of the transforms; that of the static ones has ``_static`` appended.
        base: Frame that stands still and whose Z points up.
        hand: Frame of the robot that is the gripper's frame.

    Attributes:
        reader: Receives the messages that move.
        trouble: Why the newest of them gave no motion; "" if it did.
    """

    def __init__(self, participant: DomainParticipant, topic: str, base: str, hand: str) -> None:
        self._base, self._hand = base, hand
        self._tree, self._motion = TransformTree(), PoseMotion()
        self._static = ros_reader(participant, f"{topic}_static", "tf2_msgs/TFMessage", latched=True)
        self.reader = ros_reader(participant, topic, "tf2_msgs/TFMessage")
        self.trouble = f"no transforms have come on {topic}"
        self._slow = _slow(topic, POSE_SPAN_S, "raise publish_frequency of robot_state_publisher")

    def take(self, now_s: float) -> Iterator[tuple[int, ArmReading | None]]:
        """Yield the stamp of each pose that has arrived, ns, and the motion if it gave one."""
        for reader in (self._static, self.reader):
            for message in taken(reader):
                try:
                    for transform in message.transforms:
                        self._tree.add(transform, now_s, static=reader is self._static)
                    pose = self._tree.pose(self._base, self._hand, now_s)
                except OrientationUnknown as error:
                    self.trouble = str(error)
                else:
                    self.trouble = self._slow
                    yield pose.stamp_ns, self._motion.add(pose)


class ImuReadings:
    """The motion by an IMU on the gripper.

    Args:
        participant: Of the domain.
        topic: Topic of the IMU.
        mount: Orientation of the IMU in the gripper frame.
        place_m: Its place in the gripper frame, m.

    Attributes:
        reader: Receives its messages.
        trouble: Why the newest of them gave no motion; "" if it did.
    """

    def __init__(self, participant: DomainParticipant, topic: str, mount: Quaternion, place_m: Vector) -> None:
        self._motion = ImuMotion(topic, mount, place_m)
        self.reader = ros_reader(participant, topic, "sensor_msgs/Imu")
        self.trouble = f"no message has come on {topic}"
        self._slow = _slow(topic, IMU_SPAN_S, "raise its rate")

    def take(self, now_s: float) -> Iterator[tuple[int, ArmReading | None]]:
        """Yield the stamp of each message that has arrived, ns, and the motion if it gave one."""
        for message in taken(self.reader):
            try:
                motion = self._motion.add(message)
            except OrientationUnknown as error:
                self.trouble = str(error)
            else:
                self.trouble = self._slow
                yield stamp_of(message), motion


MotionSource = Union[TransformMotion, ImuReadings]
"""Where the motion comes from."""


def _slow(topic: str, span_s: float, cure: str) -> str:
    return f"{topic} has too few new stamps within {span_s:g} s to derive the motion: {cure}"


class ArmFeed(RosFeed):
    """Pushes every motion; where it stops, the daemon's stream becomes stale.

    Args:
        participant: Of the domain.
        port: Where the readings go.
        source: Where the motion comes from.

    Raises:
        CallError: The port is not an endpoint.
    """

    def __init__(self, participant: DomainParticipant, port: ArmPort, source: MotionSource) -> None:
        super().__init__("motion of the arm")
        self._port, self._source = port, source
        self._numbers = itertools.count()
        self._pushed_s = -math.inf
        states = ViewState.Any | InstanceState.Any | SampleState.NotRead
        self._arrival = ReadCondition(source.reader, states)
        self._arrivals = WaitSet(participant)
        self._arrivals.attach(self._arrival)
        self._socket: zmq.Socket[bytes] = zmq.Context.instance().socket(zmq.PUSH)
        for option, value in ((zmq.LINGER, 0), (zmq.IMMEDIATE, 1), (zmq.SNDHWM, QUEUE)):
            self._socket.setsockopt(option, value)
        try:
            self._socket.connect(port.endpoint)
        except zmq.ZMQError as error:
            self._socket.close()
            raise CallError(f"port of [grasp.arm] must be an endpoint, got {port.endpoint!r:.80}: {error}") from error

    def stop(self) -> None:
        """End the thread, and close the connection."""
        super().stop()
        self._socket.close()

    def _wait(self) -> bool:
        self._arrivals.wait(duration(seconds=LOOK_S))
        return self._ended.is_set()

    def _send(self) -> tuple[Health, str]:
        now_s = time.monotonic()
        trouble = ""
        for newest_ns, motion in self._source.take(now_s):
            try:
                offset_ns = clock_offset_ns(newest_ns, time.time_ns(), time.monotonic_ns())
            except OrientationUnknown as error:
                trouble = str(error)
                continue
            if motion is not None and self._push(motion, offset_ns):
                self._pushed_s = now_s
            elif motion is not None:
                trouble = f"no daemon takes it at {self._port.endpoint}"
        if now_s - self._pushed_s <= STALE_S:
            return Health.OK, ""
        return Health.STALE, trouble or self._source.trouble

    def _push(self, motion: ArmReading, offset_ns: int) -> bool:
        reading = {
            "stream": self._port.sensor,
            "t_ns": motion.stamp_ns + offset_ns,
            "seq": next(self._numbers),
            "gravity_mps2": motion.gravity_mps2,
            "angular_velocity_radps": motion.angular_velocity_radps,
            "angular_acceleration_radps2": motion.angular_acceleration_radps2,
        }
        try:
            self._socket.send(encode(reading), zmq.NOBLOCK)
        except zmq.Again:
            return False
        return True
