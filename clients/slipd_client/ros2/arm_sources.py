"""What ROS nodes report of the arm, by ``/tf`` or by an IMU: its orientation at a time, or each motion that arrives."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Union

from cyclonedds.domain import DomainParticipant

from slipd_client.quaternions import Quaternion, Vector
from slipd_client.ros2.arm_stream import IMU_SPAN_S, POSE_SPAN_S, ArmReading, ImuMotion, PoseMotion
from slipd_client.ros2.dds import ros_reader, taken
from slipd_client.ros2.orientation import ImuOrientation, OrientationUnknown, TransformTree, stamp_of

TOO_SLOW = "{} has too few new stamps within {:g} s to derive the motion: {}"


class Transforms:
    """The gripper's frame by ``/tf`` and ``/tf_static``.

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
        self._slow = TOO_SLOW.format(topic, POSE_SPAN_S, "raise publish_frequency of robot_state_publisher")

    def orientation(self, now_s: float) -> Quaternion:
        """Return the orientation of the gripper's frame in a frame whose Z points up, by what has arrived.

        Raises:
            OrientationUnknown: It is not known.
        """
        refused: OrientationUnknown | None = None
        for message, static in self._arrived():
            for transform in message.transforms:
                try:
                    self._tree.add(transform, now_s, static=static)
                except OrientationUnknown as error:
                    refused = error
        try:
            return self._tree.orientation(self._base, self._hand, now_s)
        except OrientationUnknown as error:
            raise refused or error from None

    def take(self, now_s: float) -> Iterator[tuple[int, ArmReading | None]]:
        """Yield the stamp of each pose that has arrived, ns, and the motion if it gave one."""
        for message, static in self._arrived():
            try:
                for transform in message.transforms:
                    self._tree.add(transform, now_s, static=static)
                pose = self._tree.pose(self._base, self._hand, now_s)
            except OrientationUnknown as error:
                self.trouble = str(error)
            else:
                self.trouble = self._slow
                yield pose.stamp_ns, self._motion.add(pose)

    def _arrived(self) -> Iterator[tuple[Any, bool]]:
        for reader in (self._static, self.reader):
            for message in taken(reader):
                yield message, reader is self._static


class Imu:
    """The gripper's frame by an IMU on the gripper.

    Args:
        participant: Of the domain.
        topic: Topic of the IMU.
        mount: Orientation of the IMU in the gripper's frame.
        place_m: Its place in the gripper's frame, m.

    Attributes:
        reader: Receives its messages.
        trouble: Why the newest of them gave no motion; "" if it did.
    """

    def __init__(self, participant: DomainParticipant, topic: str, mount: Quaternion, place_m: Vector) -> None:
        self._orientation, self._motion = ImuOrientation(topic, mount), ImuMotion(topic, mount, place_m)
        self.reader = ros_reader(participant, topic, "sensor_msgs/Imu")
        self.trouble = f"no message has come on {topic}"
        self._slow = TOO_SLOW.format(topic, IMU_SPAN_S, "raise its rate")

    def orientation(self, now_s: float) -> Quaternion:
        """Return the orientation, as `Transforms.orientation`, by the last message that has arrived."""
        for message in taken(self.reader)[-1:]:
            self._orientation.add(message, now_s)
        return self._orientation.orientation(now_s)

    def take(self, _: float) -> Iterator[tuple[int, ArmReading | None]]:
        """Yield the stamp of each message that has arrived, ns, and the motion if it gave one."""
        for message in taken(self.reader):
            try:
                motion = self._motion.add(message)
            except OrientationUnknown as error:
                self.trouble = str(error)
            else:
                self.trouble = self._slow
                yield stamp_of(message), motion


ArmSource = Union[Transforms, Imu]
