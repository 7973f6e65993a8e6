"""The arm's motion by ``/tf`` or by an IMU of ROS, as readings of slipd's stream ``arm``, or its orientation at a time.

A parabola through a short span of readings gives the value, the rate and the acceleration in the middle of that span.
So a reading is about half a span old when it is sent, and its ``t_ns`` says so.
"""

from __future__ import annotations

import operator
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Generic, NamedTuple, TypeVar, Union

from cyclonedds.domain import DomainParticipant

from slipd_client.quaternions import (
    STANDARD_DOWN,
    Quaternion,
    Vector,
    conjugate,
    cross,
    of_rotation_vector,
    plus,
    product,
    rotated,
    rotation_vector,
)
from slipd_client.ros.dds import ros_reader, taken
from slipd_client.ros.orientation import ImuOrientation, OrientationUnknown, Pose, TransformTree, stamp_of, vector

POSE_SPAN_S = 0.04
"""Span of poses, s. The acceleration has about 0.01 m/s² noise for each micrometre of the positions' at 250 Hz."""

IMU_SPAN_S = 0.02
"""Span of IMU messages, s: only the angular acceleration is a derivative."""

DENSITY = 16
"""Readings closer than this part of the span are left out: they cost time, and show little more."""

LATEST_S, EARLIEST_S = 0.25, 0.02
"""A stamp may be so much earlier or later than this machine's clock at its arrival, s."""


class ArmReading(NamedTuple):
    """One reading of the stream, in the gripper frame (docs/arm.md).

    Attributes:
        stamp_ns: When the motion was, ns of the clock of the stamps.
        gravity_mps2: Gravity minus the acceleration of the origin.
        angular_velocity_radps: Angular velocity.
        angular_acceleration_radps2: Angular acceleration.
    """

    stamp_ns: int
    gravity_mps2: Vector
    angular_velocity_radps: Vector
    angular_acceleration_radps2: Vector


T = TypeVar("T")


class _Span(Generic[T]):
    """The newest readings.

    Args:
        span_s: Time from the oldest to the newest, s.
        least: Fewest readings for a fit.

    Attributes:
        readings: Stamp, ns → reading, the oldest first.
    """

    def __init__(self, span_s: float, least: int) -> None:
        self._span_ns, self._least = round(span_s * 1e9), least
        self.readings: dict[int, T] = {}

    def add(self, stamp_ns: int, reading: T) -> bool:
        """Note a reading; return whether it is new, and there are enough for a fit."""
        if self.readings:
            passed_ns = stamp_ns - next(reversed(self.readings))
            if 0 <= passed_ns < self._span_ns // DENSITY:
                return False
            if passed_ns < 0:  # the clock of the stamps was set back
                self.readings.clear()
        self.readings[stamp_ns] = reading
        while (oldest_ns := next(iter(self.readings))) < stamp_ns - self._span_ns:
            del self.readings[oldest_ns]
        return len(self.readings) >= self._least and stamp_ns - oldest_ns >= self._span_ns // 2

    @property
    def middle_ns(self) -> int:
        """Mean time of the readings, ns."""
        return sum(self.readings) // len(self.readings)

    def fit(self, rows: Iterable[Sequence[float]]) -> tuple[Vector, Vector, Vector]:
        """Return value, first and second derivative of a parabola at `middle_ns`, for each of three columns.

        Args:
            rows: Three numbers for each reading.
        """
        middle_ns = self.middle_ns
        times = [(stamp_ns - middle_ns) * 1e-9 for stamp_ns in self.readings]
        count, second = len(times), sum(t * t for t in times)
        third = sum(t**3 for t in times)
        bows = [t * t - third / second * t - second / count for t in times]  # orthogonal to 1 and t
        strength = sum(bow * bow for bow in bows)
        fits = []
        for column in zip(*rows, strict=True):
            bend = sum(map(operator.mul, column, bows)) / strength if strength > 1e-9 * second**2 else 0.0
            slope = sum(map(operator.mul, column, times)) / second - bend * third / second
            fits.append((sum(column) / count - bend * second / count, slope, 2.0 * bend))
        x, y, z = fits
        return (x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])


class PoseMotion:
    """The motion of the gripper by its poses in a frame that stands still and whose Z points up."""

    def __init__(self) -> None:
        self._span: _Span[Pose] = _Span(POSE_SPAN_S, least=3)

    def add(self, pose: Pose) -> ArmReading | None:
        """Note a pose; return the motion, or None for a pose that is not new, or while the span fills."""
        if not self._span.add(pose.stamp_ns, pose):
            return None
        poses = list(self._span.readings.values())
        middle = poses[len(poses) // 2].rotation
        back = conjugate(middle)
        turned, velocity, acceleration = self._span.fit([rotation_vector(product(back, p.rotation)) for p in poses])
        _, _, (ax, ay, az) = self._span.fit([p.position_m for p in poses])
        to_gripper = conjugate(product(middle, of_rotation_vector(turned)))
        gravity = rotated(to_gripper, plus(STANDARD_DOWN, (-ax, -ay, -az)))
        return ArmReading(self._span.middle_ns, gravity, velocity, acceleration)


class ImuMotion:
    """The motion of the gripper by a ``sensor_msgs/Imu`` (REP 145) on it; its orientation is not needed.

    Args:
        topic: Its topic, for error texts.
        mount: Orientation of the IMU in the gripper frame.
        place_m: Its place in the gripper frame, m.
    """

    def __init__(self, topic: str, mount: Quaternion, place_m: Vector) -> None:
        self._topic, self._mount, self._place_m = topic, mount, place_m
        self._span: _Span[tuple[Vector, Vector]] = _Span(IMU_SPAN_S, least=2)

    def add(self, imu: Any) -> ArmReading | None:
        """Note a message; return the motion, or None for one that is not new, or while the span fills.

        Raises:
            OrientationUnknown: The message has no acceleration, or no angular velocity.
        """
        for name in ("linear_acceleration", "angular_velocity"):
            if getattr(imu, f"{name}_covariance")[0] == -1.0:
                raise OrientationUnknown(f"{self._topic} has no {name} ({name}_covariance[0] is -1)")
        reading = tuple(rotated(self._mount, vector(each)) for each in (imu.linear_acceleration, imu.angular_velocity))
        if not self._span.add(stamp_of(imu), (reading[0], reading[1])):
            return None
        (fx, fy, fz), _, _ = self._span.fit([force for force, _ in self._span.readings.values()])
        velocity, acceleration, _ = self._span.fit([turn for _, turn in self._span.readings.values()])
        turning = cross(velocity, cross(velocity, self._place_m))
        here = plus((-fx, -fy, -fz), plus(cross(acceleration, self._place_m), turning))
        return ArmReading(self._span.middle_ns, here, velocity, acceleration)


def clock_offset_ns(arrived_ns: int, wall_ns: int, now_ns: int) -> int:
    """Return CLOCK_MONOTONIC minus the clock of the stamps, ns.

    Args:
        arrived_ns: Stamp of a message that has just arrived.
        wall_ns: This machine's clock, ns since 1970.
        now_ns: CLOCK_MONOTONIC at the same moment.

    Raises:
        OrientationUnknown: The two clocks differ, so that the age of the message is not known.
    """
    age_s = (wall_ns - arrived_ns) * 1e-9
    if not -EARLIEST_S <= age_s <= LATEST_S:
        raise OrientationUnknown(
            f"its stamps are {age_s:.3g} s behind this machine's clock: synchronise the clocks of the machines; "
            "simulated time is not used"
        )
    return now_ns - wall_ns


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
        refused = next(filter(None, [*self._update(now_s)]), None)
        try:
            return self._tree.orientation(self._base, self._hand, now_s)
        except OrientationUnknown as error:
            raise refused or error from None

    def read(self, now_s: float) -> Iterator[tuple[int, ArmReading | None]]:
        """Yield the stamp of each pose that has arrived, ns, and the motion if it gave one."""
        for refused in self._update(now_s):
            try:
                pose = self._tree.pose(self._base, self._hand, now_s)
            except OrientationUnknown as error:
                self.trouble = str(refused or error)
            else:
                self.trouble = self._slow
                yield pose.stamp_ns, self._motion.add(pose)

    def _update(self, now_s: float) -> Iterator[OrientationUnknown | None]:
        """Update the tree with each message that has arrived; yield why a transform of it is not used, or None."""
        for reader in (self._static, self.reader):
            for message in taken(reader):
                refused: OrientationUnknown | None = None
                for transform in message.transforms:
                    try:
                        self._tree.add(transform, now_s, static=reader is self._static)
                    except OrientationUnknown as error:
                        refused = error
                yield refused


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

    def read(self, _: float) -> Iterator[tuple[int, ArmReading | None]]:
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
