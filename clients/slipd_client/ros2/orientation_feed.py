"""Sends the daemon the arm's orientation that ROS nodes publish: ``gravity.set`` at 10 Hz for each finger."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any, Union

from cyclonedds.domain import DomainParticipant
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from slipd_client.errors import ClientError
from slipd_client.gravity_feed import OBSTACLE_S, PERIOD_S
from slipd_client.grip import GripClient
from slipd_client.messages.names import Health
from slipd_client.ros.conversion import TYPES, Entry, entry
from slipd_client.ros.ros_types import type_hash
from slipd_client.ros2.dds import dds_topic_name, decoded_type
from slipd_client.ros2.orientation import (
    ImuOrientation,
    OrientationUnknown,
    Quaternion,
    TransformTree,
    pad_gravities,
)

DEPTH = 100
"""Longest queue of received messages."""


class TransformSource:
    """The orientation by ``/tf`` and ``/tf_static``.

    Args:
        participant: Of the domain.
        topic: Topic of the transforms; that of the static ones has ``_static`` appended.
        base: Frame whose Z points up.
        hand: Frame of the robot that is the gripper's frame.
    """

    def __init__(self, participant: DomainParticipant, topic: str, base: str, hand: str) -> None:
        self._base, self._hand = base, hand
        self._tree = TransformTree()
        static = f"{topic}_static"
        self._readers = (
            (ros_reader(participant, static, "tf2_msgs/TFMessage", latched=True), True),
            (ros_reader(participant, topic, "tf2_msgs/TFMessage"), False),
        )

    def orientation(self, now_s: float) -> Quaternion:
        """Return the orientation of the gripper's frame in a frame whose Z points up, by what has arrived.

        Raises:
            OrientationUnknown: It is not known.
        """
        refused: OrientationUnknown | None = None
        for reader, static in self._readers:
            for message in taken(reader):
                for transform in message.transforms:
                    try:
                        self._tree.add(transform, now_s, static=static)
                    except OrientationUnknown as error:
                        refused = error
        try:
            return self._tree.orientation(self._base, self._hand, now_s)
        except OrientationUnknown as error:
            raise refused or error from None


class ImuSource:
    """The orientation by an IMU on the gripper.

    Args:
        participant: Of the domain.
        topic: Topic of the IMU.
        mount: Orientation of the IMU in the gripper's frame.
    """

    def __init__(self, participant: DomainParticipant, topic: str, mount: Quaternion) -> None:
        self._imu = ImuOrientation(topic, mount)
        self._reader = ros_reader(participant, topic, "sensor_msgs/Imu")

    def orientation(self, now_s: float) -> Quaternion:
        """Return it, by the last message that has arrived."""
        for message in taken(self._reader)[-1:]:
            self._imu.add(message, now_s)
        return self._imu.orientation(now_s)


OrientationSource = Union[TransformSource, ImuSource]
"""Where the orientation comes from."""


class RosFeed(threading.Thread):
    """Sends the daemon what ROS reports of the arm, and reports failures.

    Args:
        what: What is sent, for people.
    """

    def __init__(self, what: str) -> None:
        super().__init__(name=what, daemon=True)
        self._what = what
        self._ended = threading.Event()
        self._state = (Health.STALE, f"no {what} yet")
        self._well_s = time.monotonic()
        self._told = ""

    @property
    def entry(self) -> Entry:
        """State of the feed, as an entry of ``/diagnostics``."""
        level, why = self._state
        return entry(f"{self._what} from ROS", level, why, "", {})

    def run(self) -> None:
        """Send until `stop`."""
        while not self._wait():
            try:
                self._state = self._send()
            except Exception as error:  # a message that cannot be decoded, for example; the next one may be well
                self._state = (Health.ERROR, f"{type(error).__name__}: {error}")
            self._tell(*self._state)

    def stop(self) -> None:
        """End the thread."""
        self._ended.set()
        self.join()

    def _wait(self) -> bool:
        """Wait until there is something to send; return whether the feed has ended."""
        return self._ended.wait(PERIOD_S)

    def _send(self) -> tuple[Health, str]:
        """Send what is new; return the state and the reason for it."""
        raise NotImplementedError

    def _tell(self, level: Health, why: str) -> None:
        """Print a failure that has lasted for a while, and its end."""
        now_s = time.monotonic()
        if level is Health.OK:
            self._well_s = now_s
            if self._told:
                print(f"slipctl: the {self._what} is sent again", file=sys.stderr, flush=True)
            self._told = ""
        elif why != self._told and now_s - self._well_s > OBSTACLE_S:
            print(f"slipctl: no {self._what} is sent: {why}", file=sys.stderr, flush=True)
            self._told = why


class OrientationFeed(RosFeed):
    """Sends the orientation while it is known; the daemon forgets it 0.25 s after the last one.

    Args:
        client: Sends the requests, from this thread alone.
        source: Where the orientation comes from.
        pads: Orientation of each pad in the gripper's frame.
    """

    def __init__(self, client: GripClient, source: OrientationSource, pads: Mapping[str, Sequence[float]]) -> None:
        super().__init__("orientation")
        self._client, self._source, self._pads = client, source, pads

    def _send(self) -> tuple[Health, str]:
        try:
            gripper = self._source.orientation(time.monotonic())
        except OrientationUnknown as error:
            return Health.STALE, str(error)
        refused: ClientError | None = None
        for finger, gravity_mps2 in pad_gravities(gripper, self._pads).items():
            try:
                self._client.gravity_set(finger, gravity_mps2)
            except ClientError as error:
                refused = error
        return (Health.OK, "") if refused is None else (Health.ERROR, str(refused))


def ros_reader(
    participant: DomainParticipant, topic: str, kind: str, *, latched: bool = False, reliable: bool = False
) -> DataReader[Any]:
    """Return a reader of a topic.

    Args:
        participant: Of the domain.
        topic: The topic.
        kind: Its type, "package/Name".
        latched: Receive the messages from before too, from publishers that keep them.
        reliable: Lose none, from publishers that send again what was lost; so does ``latched``.
    """
    lossless = Policy.Reliability.Reliable(max_blocking_time=0)
    qos = Qos(
        lossless if reliable or latched else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(DEPTH),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(f"typehash={type_hash(kind, TYPES)};".encode()),
    )
    return DataReader(participant, Topic(participant, dds_topic_name(topic), decoded_type(kind)), qos)


def taken(reader: DataReader[Any]) -> list[Any]:
    """Return the messages that have arrived, without the sample that reports the end of their last publisher."""
    return [sample for sample in reader.take(DEPTH) if sample.sample_info.valid_data]
