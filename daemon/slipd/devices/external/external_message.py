"""Format of the readings that another process sends, and its encoder.

Each message is one msgpack map, `{stream, t_ns, force_n, torque_nm}`, `{stream, t_ns, values}`,
`{stream, t_ns, object_pose, object_speed_mps}` or `{stream, t_ns, gravity_mps2, angular_velocity_radps}`;
docs/devices.md describes it. Messages are self-delimiting, so no transport needs to deliver them one by one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import msgpack
import numpy as np
from numpy.typing import ArrayLike

from slipd.devices.shared.msgpack_messages import MessageReader, are_numbers, checked, read_message

MAX_MESSAGE = 1 << 16
"""Longest message, bytes; a pad of 64 by 64 taxels fills 37,000."""

MAX_TAXELS = 4096
"""The largest pad that a config can describe, 64 by 64."""

AXES = 3

UNIT_TOLERANCE = 0.01
"""A quaternion is as long as 1 within this."""

_MOTION = {"gravity_mps2", "angular_velocity_radps"}
READINGS = (
    {"force_n"},
    {"force_n", "torque_nm"},
    {"values"},
    {"object_pose"},
    _MOTION,
    _MOTION | {"angular_acceleration_radps2"},
)
SPEED = {"object_speed_mps", "object_speed_std_mps"}
"""Fields of a reading: those of a force, of an image, of an arm's motion, or of an object: its pose, its speed with its
error, or both."""

_LATEST_NS = 1 << 63  # CLOCK_MONOTONIC is a signed 64-bit number
_NAME = re.compile(r"[A-Za-z0-9_./-]{1,64}")
_WORD = re.compile(r"[a-z][a-z0-9_]{0,31}")


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
    if not data or read(data, 0)[0] != len(data):
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


def _is_time(value: object) -> bool:
    return type(value) is int and 0 <= value < _LATEST_NS


def _is_vector(value: object, length: int = AXES) -> bool:
    return isinstance(value, tuple) and len(value) == length and are_numbers(value)


def _is_orientation(value: Any) -> bool:
    """Return whether a value is a quaternion of unit length; one that is not finite is marked later."""
    if not _is_vector(value, 4):
        return False
    return not all(map(math.isfinite, value)) or abs(math.hypot(*value) - 1.0) < UNIT_TOLERANCE


def _is_status(value: object) -> bool:
    return isinstance(value, tuple) and all(isinstance(word, str) and _WORD.fullmatch(word) for word in value)


def _read_pose(reader: MessageReader) -> dict[str, Any]:
    pose = reader.fields({"xyz_m": _VECTOR, "quat_xyzw": checked(_is_orientation)})
    if "xyz_m" not in pose:
        raise ValueError("no position")
    return pose


def _read_image(reader: MessageReader) -> list[Any]:
    taxels = reader.items(MAX_TAXELS)
    if not taxels or not (are_numbers(taxels) or all(map(_is_vector, taxels))):
        raise ValueError("no image")
    return taxels


_VECTOR = checked(_is_vector)
_NUMBER = checked(lambda value: are_numbers((value,)))
_READ_VALUES = {
    "stream": checked(lambda value: isinstance(value, str) and _NAME.fullmatch(value)),
    "t_ns": checked(_is_time),
    "seq": checked(lambda value: type(value) is int and value >= 0),
    "force_n": _VECTOR,
    "torque_nm": checked(lambda value: value is None or _is_vector(value)),
    "values": _read_image,
    "object_pose": _read_pose,
    "object_speed_mps": _NUMBER,
    "object_speed_std_mps": checked(lambda value: are_numbers((value,)) and not value <= 0.0),
    "gravity_mps2": _VECTOR,
    "angular_velocity_radps": _VECTOR,
    "angular_acceleration_radps2": _VECTOR,
    "status": checked(_is_status),
}
"""How the value of each key is read."""


def _parse(reader: MessageReader) -> dict[str, Any] | None:
    """Return the fields of a message; None if they are not those of one reading."""
    fields = reader.fields(_READ_VALUES)
    reading = fields.keys() - {"stream", "t_ns", "seq", "status"}
    is_reading = reading in READINGS or reading - {"object_pose"} == SPEED
    return fields if is_reading and {"stream", "t_ns"} <= fields.keys() else None


def read(buffer: bytes, at: int) -> tuple[int, dict[str, Any] | None]:
    """Return length and fields of the message at ``at``, see `read_message`."""
    return read_message(buffer, at, MAX_MESSAGE, _parse)
