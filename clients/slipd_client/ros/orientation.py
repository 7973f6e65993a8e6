"""The arm's orientation from ROS messages, as gravity in the frames of the pads. Pure: no ROS, no DDS, no clock.

Messages are objects with the attributes of their ROS types, of whichever library. A quaternion x, y, z, w is the
orientation of a frame in another one: it takes coordinates of the first to the second.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from slipd_client import quaternions
from slipd_client.errors import CallError
from slipd_client.quaternions import IDENTITY, Quaternion, Vector, conjugate, plus, product, rotated

STALE_S = 0.3
"""Age at which an orientation is no longer used, s: three periods of a publisher at 10 Hz."""


class OrientationUnknown(Exception):  # noqa: N818 - it is a state, not a fault
    """The orientation is not known; the text says why."""


class _Link(NamedTuple):
    parent: str
    rotation: Quaternion
    translation_m: Vector
    stamp_ns: int
    since_s: float


class Pose(NamedTuple):
    """A frame in its base at a time.

    Attributes:
        stamp_ns: Time of the transforms that move, ns of ROS's clock.
        position_m: Its origin in the base.
        rotation: Its orientation in the base.
    """

    stamp_ns: int
    position_m: Vector
    rotation: Quaternion


class TransformTree:
    """The frames of ``/tf`` and ``/tf_static``."""

    def __init__(self) -> None:
        self._links: dict[str, _Link] = {}

    def add(self, transform: Any, now_s: float, *, static: bool) -> None:
        """Note a ``geometry_msgs/TransformStamped``.

        A transform that is sent again with the same stamp is no newer for that.

        Args:
            transform: The message.
            now_s: Time of its arrival, s of any clock.
            static: It is of ``/tf_static``, and never stale.

        Raises:
            OrientationUnknown: Its rotation is no unit quaternion; the transform before it stays.
        """
        child, parent = transform.child_frame_id, transform.header.frame_id
        rotation = unit(transform.transform.rotation, f"the transform from {parent!r} to {child!r}")
        translation_m = vector(transform.transform.translation)
        stamp_ns = stamp_of(transform)
        before = self._links.get(child)
        if static or before is None or before.parent != parent or before.stamp_ns != stamp_ns:
            self._links[child] = _Link(parent, rotation, translation_m, stamp_ns, math.inf if static else now_s)

    def orientation(self, base: str, frame: str, now_s: float) -> Quaternion:
        """Return the orientation of a frame in ``base``, which is above it in the tree.

        Raises:
            OrientationUnknown: No transforms lead from one to the other, or one of them is stale.
        """
        rotation = IDENTITY
        for link in self._chain(base, frame, now_s):
            rotation = product(link.rotation, rotation)
        return rotation

    def pose(self, base: str, frame: str, now_s: float) -> Pose:
        """Return the pose of a frame in ``base``, which is above it in the tree.

        Raises:
            OrientationUnknown: As for `orientation`, or the transforms that move are not of one time.
        """
        position_m, rotation = (0.0, 0.0, 0.0), IDENTITY
        stamps = set()
        for link in self._chain(base, frame, now_s):
            position_m = plus(link.translation_m, rotated(link.rotation, position_m))
            rotation = product(link.rotation, rotation)
            if link.since_s != math.inf:
                stamps.add(link.stamp_ns)
        if len(stamps) != 1:
            raise OrientationUnknown(
                f"the transforms from {frame!r} up to {base!r} must move and have one stamp, got {len(stamps)}"
            )
        return Pose(stamps.pop(), position_m, rotation)

    def _chain(self, base: str, frame: str, now_s: float) -> Iterator[_Link]:
        """Yield the transforms from a frame up to ``base``."""
        at = frame
        for _ in range(len(self._links) + 1):
            if at == base:
                return
            link = self._links.get(at)
            if link is None:
                raise OrientationUnknown(
                    f"no transforms lead from {frame!r} up to {base!r}: "
                    + (f"the topmost frame is {at!r}" if at != frame else f"none has the child {frame!r}")
                )
            if now_s - link.since_s > STALE_S:
                raise OrientationUnknown(
                    f"the transform from {link.parent!r} to {at!r} is older than {STALE_S:g} s, "
                    "or repeats with the same stamp"
                )
            yield link
            at = link.parent
        raise OrientationUnknown(f"the transforms from {frame!r} upwards form a ring")


class ImuOrientation:
    """The orientation of the gripper's frame by a ``sensor_msgs/Imu``.

    Args:
        topic: Its topic, for error texts.
        mount: Orientation of the IMU in the gripper's frame.
    """

    def __init__(self, topic: str, mount: Quaternion = IDENTITY) -> None:
        self._topic = topic
        self._mount = mount
        self._gripper = IDENTITY
        self._stamp_ns: int | None = None
        self._since_s = -math.inf

    def add(self, imu: Any, now_s: float) -> None:
        """Note a message.

        Args:
            imu: The message: the orientation of the IMU in a frame whose Z points up (REP 145).
            now_s: Time of its arrival, s of any clock.

        Raises:
            OrientationUnknown: It has no orientation, or one that is no unit quaternion.
        """
        if imu.orientation_covariance[0] == -1.0:
            raise OrientationUnknown(
                f"{self._topic} has no orientation (orientation_covariance[0] is -1): use the topic of a filter that "
                "estimates it"
            )
        orientation = unit(imu.orientation, f"the orientation of {self._topic}")
        if (stamp_ns := stamp_of(imu)) != self._stamp_ns:
            self._stamp_ns, self._since_s = stamp_ns, now_s
            self._gripper = product(orientation, conjugate(self._mount))

    def orientation(self, now_s: float) -> Quaternion:
        """Return the orientation of the gripper's frame in one whose Z points up.

        Raises:
            OrientationUnknown: No orientation has arrived, or the newest is stale.
        """
        if self._stamp_ns is None:
            raise OrientationUnknown(f"no message has come on {self._topic}")
        if now_s - self._since_s > STALE_S:
            raise OrientationUnknown(f"{self._topic} is silent for more than {STALE_S:g} s, or repeats one stamp")
        return self._gripper


def stamp_of(message: Any) -> int:
    """Return the time in the header of a message, ns."""
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


def unit(rotation: Any, what: str) -> Quaternion:
    """Return a ``geometry_msgs/Quaternion`` with length 1.

    Raises:
        OrientationUnknown: Its length is not near 1; the text begins with ``what``.
    """
    try:
        return quaternions.unit((rotation.x, rotation.y, rotation.z, rotation.w), what)
    except CallError as error:
        raise OrientationUnknown(str(error)) from None


def vector(message: Any) -> Vector:
    """Return the numbers of a ``geometry_msgs/Vector3``."""
    return message.x, message.y, message.z
