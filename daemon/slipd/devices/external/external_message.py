"""Format of the readings that another process sends, and its encoder.

Each message is one msgpack map, `{stream, t_ns, force_n, torque_nm}`, `{stream, t_ns, values}`,
`{stream, t_ns, object_pose, object_speed_mps}` or `{stream, t_ns, gravity_mps2, angular_velocity_radps}`;
docs/devices.md describes it. Messages are self-delimiting, so no transport needs to deliver them one by one. The bounds
of a message are checked first (`slipd.devices.shared.msgpack_messages`): only a map of known keys with values of the
right types is unpacked.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import msgpack
import numpy as np
from numpy.typing import ArrayLike

from slipd.devices.shared.msgpack_messages import (
    NIL,
    NUMBER_LENGTHS,
    Malformed,
    byte_at,
    list_head,
    map_end,
    message_length,
    numbers_end,
    text_end,
    unsigned_end,
    vector_end,
)

MAX_MESSAGE = 1 << 16
"""Longest message, bytes; a pad of 64 by 64 taxels fills 37,000."""

MAX_TAXELS = 4096
"""The largest pad that a config can describe, 64 by 64."""

MAX_NAME = 64
MAX_STATUS = 8
MAX_WORD = 32

AXES = 3
FIELDS = range(3, 8)
"""Numbers of fields: ``stream``, ``t_ns`` and a reading of one to three fields; optionally ``seq`` and ``status``."""

UNIT_TOLERANCE = 0.01
"""A quaternion is as long as 1 within this."""

_MOTION = {b"gravity_mps2", b"angular_velocity_radps"}
READINGS = (
    {b"force_n"},
    {b"force_n", b"torque_nm"},
    {b"values"},
    {b"object_pose"},
    _MOTION,
    _MOTION | {b"angular_acceleration_radps2"},
)
SPEED = {b"object_speed_mps", b"object_speed_std_mps"}
"""Fields of a reading: those of a force, of an image, of an arm's motion, or of an object: its pose, its speed with its
error, or both."""

_LATEST_NS = 1 << 63  # CLOCK_MONOTONIC is a signed 64-bit number
_NAME = re.compile(r"[A-Za-z0-9_./-]+")
_WORD = re.compile(r"[a-z][a-z0-9_]*")


def parse(data: bytes) -> dict[str, Any] | None:
    """Unpack a measured message; return None if a name or a time is impossible."""
    try:
        body: dict[str, Any] = msgpack.unpackb(data)
    except UnicodeDecodeError:
        return None
    is_possible = (
        _NAME.fullmatch(body["stream"])
        and body["t_ns"] < _LATEST_NS
        and all(_WORD.fullmatch(word) for word in body.get("status", ()))
        and _is_orientation(body.get("object_pose", {}).get("quat_xyzw"))
        and not body.get("object_speed_std_mps", 1.0) <= 0.0
    )
    return body if is_possible else None


def encode_reading(
    stream: str,
    t_ns: int,
    *,
    force_n: ArrayLike | None = None,
    torque_nm: ArrayLike | None = None,
    values: ArrayLike | None = None,
    object_pose: Mapping[str, ArrayLike] | None = None,
    object_speed_mps: float | None = None,
    object_speed_std_mps: float | None = None,
    gravity_mps2: ArrayLike | None = None,
    angular_velocity_radps: ArrayLike | None = None,
    angular_acceleration_radps2: ArrayLike | None = None,
    seq: int | None = None,
    status: Sequence[str] = (),
) -> bytes:
    """Return the message of one reading.

    Args:
        stream: Name of the stream: up to 64 letters, digits and ``_./-``.
        t_ns: CLOCK_MONOTONIC when the reading was taken.
        force_n: Force, shape (3,), N.
        torque_nm: Torque about the sensor's origin, shape (3,), N·m; only beside a force, and only if measured.
        values: An image instead of a force, shape (taxels,) or (taxels, 3), in scan order.
        object_pose: Pose of the object in the gripper frame instead of these: ``xyz_m``, shape (3,), m, and where it is
            known ``quat_xyzw``, shape (4,).
        object_speed_mps: Speed of the object over the pads, m/s, beside its pose or instead of it.
        object_speed_std_mps: Standard deviation of that speed, above 0.
        gravity_mps2: Gravity minus the acceleration of the gripper frame's origin instead of these, in that frame,
            shape (3,), m/s².
        angular_velocity_radps: Angular velocity beside it, shape (3,), rad/s.
        angular_acceleration_radps2: Angular acceleration beside these, shape (3,), rad/s², where it is known.
        seq: Sequence number of the stream's readings, if it has one.
        status: Conditions of this reading, up to 8 short words.

    Raises:
        ValueError: A receiver would reject the message.
    """
    numbers = {
        "force_n": force_n,
        "torque_nm": torque_nm,
        "values": values,
        "gravity_mps2": gravity_mps2,
        "angular_velocity_radps": angular_velocity_radps,
        "angular_acceleration_radps2": angular_acceleration_radps2,
        "object_pose": object_pose,
        "object_speed_mps": object_speed_mps,
        "object_speed_std_mps": object_speed_std_mps,
    }
    body = {"stream": stream, "t_ns": t_ns} | {
        key: _plain(value) for key, value in numbers.items() if value is not None
    }
    if seq is not None:
        body["seq"] = seq
    if status:
        body["status"] = list(status)
    try:
        data: bytes = msgpack.packb(body)
    except OverflowError:
        data = b""
    if not data or measure(data, 0) != len(data) or parse(data) is None:
        raise ValueError(
            f"a reading must have a valid name and time, and either a force of shape (3,), with or without a torque of "
            f"shape (3,), or values of shape (taxels,) or (taxels, 3), with at most {MAX_TAXELS} taxels and "
            f"{MAX_MESSAGE} bytes, or the pose of an object, its speed with a standard deviation, or both, or gravity "
            f"and angular velocity of an arm, of shape (3,), got stream {stream!r:.80}"
        )
    return data


def _plain(numbers: Mapping[str, ArrayLike] | ArrayLike) -> Any:
    """Return numbers as msgpack has them: floats, in lists and maps."""
    if isinstance(numbers, Mapping):
        return {key: _plain(part) for key, part in numbers.items()}
    return np.asarray(numbers, dtype=np.float64).tolist()


def _message_end(buffer: bytes, at: int) -> int:
    end, keys = map_end(buffer, at, FIELDS, _VALUE_ENDS)
    reading = keys - {b"stream", b"t_ns", b"seq", b"status"}
    if not {b"stream", b"t_ns"} <= keys:
        raise Malformed
    if reading not in READINGS and reading - {b"object_pose"} != SPEED:
        raise Malformed
    return end


measure = partial(message_length, _message_end, MAX_MESSAGE)
"""``measure(buffer, at)`` returns the length of the message at ``at``; 0 if more bytes may decide, -1 for none."""


_vector_end = vector_end(AXES)


def _torque_end(buffer: bytes, at: int) -> int:
    return at + 1 if byte_at(buffer, at) == NIL else _vector_end(buffer, at)


def _values_end(buffer: bytes, at: int) -> int:
    count, begin = list_head(buffer, at, range(1, MAX_TAXELS + 1))
    if byte_at(buffer, begin) in NUMBER_LENGTHS:
        return numbers_end(buffer, begin, count)
    for _ in range(count):
        begin = _vector_end(buffer, begin)
    return begin


def _number_end(buffer: bytes, at: int) -> int:
    return numbers_end(buffer, at, 1)


def _pose_end(buffer: bytes, at: int) -> int:
    end, keys = map_end(buffer, at, range(1, 3), {b"xyz_m": _vector_end, b"quat_xyzw": vector_end(4)})
    if b"xyz_m" not in keys:
        raise Malformed
    return end


def _is_orientation(quat_xyzw: Sequence[float] | None) -> bool:
    """Return whether a quaternion is missing or has unit length; values that are not finite are marked later."""
    if quat_xyzw is None or not all(map(math.isfinite, quat_xyzw)):
        return True
    return abs(math.hypot(*quat_xyzw) - 1.0) < UNIT_TOLERANCE


def _status_end(buffer: bytes, at: int) -> int:
    count, at = list_head(buffer, at, range(MAX_STATUS + 1))
    for _ in range(count):
        at = text_end(buffer, at, 1, MAX_WORD)
    return at


_VALUE_ENDS = {
    b"stream": lambda buffer, at: text_end(buffer, at, 1, MAX_NAME),
    b"t_ns": unsigned_end,
    b"seq": unsigned_end,
    b"force_n": _vector_end,
    b"torque_nm": _torque_end,
    b"values": _values_end,
    b"object_pose": _pose_end,
    b"object_speed_mps": _number_end,
    b"object_speed_std_mps": _number_end,
    b"gravity_mps2": _vector_end,
    b"angular_velocity_radps": _vector_end,
    b"angular_acceleration_radps2": _vector_end,
    b"status": _status_end,
}
"""For each key, where its value ends."""
