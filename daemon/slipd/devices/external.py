"""Readings that another process sends: a driver that holds the port of a sensor, a camera, or what moves the arm.

Each reading is one msgpack map, `{stream, t_ns, force_n, torque_nm}`, `{stream, t_ns, values}`,
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

from slipd.devices import Device
from slipd.devices.shared.frame_scanner import FrameDecoder, MessageScanner
from slipd.devices.shared.msgpack_messages import MessageReader, are_numbers, checked, converted, read_message
from slipd.devices.shared.sequence_tracker import SequenceTracker
from slipd.types.arrays import Array
from slipd.types.samples import ArmSample, ObjectSample, TactileSample, WrenchSample

MAX_MESSAGE = 1 << 16
"""Longest message, bytes; a pad of 64 by 64 taxels fills 37,000."""

MAX_TAXELS = 4096
"""The largest pad that a config can describe, 64 by 64."""

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


def _vector(value: Any, length: int = 3) -> tuple[float, ...]:
    if not (isinstance(value, tuple) and len(value) == length and are_numbers(value)):
        raise ValueError("no vector")
    return tuple(map(float, value))


def _orientation(value: Any) -> tuple[float, ...]:
    """Return a quaternion of unit length; one that is not finite is marked later."""
    quaternion = _vector(value, 4)
    if all(map(math.isfinite, quaternion)) and abs(math.hypot(*quaternion) - 1.0) >= UNIT_TOLERANCE:
        raise ValueError("no orientation")
    return quaternion


def _is_status(value: object) -> bool:
    return isinstance(value, tuple) and all(isinstance(word, str) and _WORD.fullmatch(word) for word in value)


def _read_pose(reader: MessageReader) -> dict[str, Any]:
    pose = reader.fields({"xyz_m": _VECTOR, "quat_xyzw": converted(_orientation)})
    if "xyz_m" not in pose:
        raise ValueError("no position")
    return pose


def _read_image(reader: MessageReader) -> list[Any]:
    taxels = reader.items(MAX_TAXELS)
    if not taxels:
        raise ValueError("no image")
    return taxels if are_numbers(taxels) else [*map(_vector, taxels)]


_VECTOR = converted(_vector)
_NUMBER = checked(lambda value: are_numbers((value,)))
_READ_VALUES = {
    "stream": checked(lambda value: isinstance(value, str) and _NAME.fullmatch(value)),
    "t_ns": checked(lambda value: type(value) is int and 0 <= value < _LATEST_NS),
    "seq": checked(lambda value: type(value) is int and value >= 0),
    "force_n": _VECTOR,
    "torque_nm": converted(lambda value: None if value is None else _vector(value)),
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


def _parse(reader: MessageReader) -> dict[str, Any]:
    """Return the fields of a message; raise ValueError if they are not those of one reading."""
    fields = reader.fields(_READ_VALUES)
    reading = fields.keys() - {"stream", "t_ns", "seq", "status"}
    is_reading = reading in READINGS or reading - {"object_pose"} == SPEED
    if not (is_reading and {"stream", "t_ns"} <= fields.keys()):
        raise ValueError("no reading")
    return fields


def read(buffer: bytes, at: int) -> tuple[int, dict[str, Any] | None]:
    """Return length and fields of the message at ``at``, see `read_message`."""
    return read_message(buffer, at, MAX_MESSAGE, _parse)


MAX_STREAMS = 64
"""Most streams with sequence numbers on one socket: limits the memory that invented names can fill."""

Reading = WrenchSample | TactileSample | ObjectSample | ArmSample

_SEQ_SPAN = 1 << 64
_BEGIN = re.compile(rb"[\x83-\x87](?:[\xa3-\xbb](?:[a-z]|\Z)|\Z)")  # a map of 3 to 7 fields; a key of 3 to 27 letters


class Decoder(FrameDecoder):
    """Decode every message to a wrench, tactile, object or arm sample; ``source`` is its ``stream``.

    ``device_time_ns`` is the message's ``t_ns``: CLOCK_MONOTONIC on this host at the acquisition, as reported by the
    sender. `health.lost`, `duplicates` and `restarts` follow ``seq``, for streams that send it. Bytes outside messages
    are `bad_bytes`, and each stretch of them is one `bad`; so is a message with an unknown key, a value of the wrong
    type or a number out of range.

    Status names: those of the message, and "invalid" if a value is not finite, or a speed is beyond any multiple of its
    error.
    """

    _frames: MessageScanner[dict[str, Any]]

    def __init__(self) -> None:
        super().__init__()
        self._frames = MessageScanner(_BEGIN, read, self.health)
        self._sequences: dict[str, SequenceTracker] = {}

    def _readings(self, data: bytes, t_ns: int) -> list[Reading]:
        return [_sample(body, t_ns) for body in self._frames.messages(data) if self._is_new(body)]

    def forget(self) -> None:
        """Drop a partial message and the expected sequence numbers, because the line was closed."""
        super().forget()
        self._sequences.clear()

    def _is_new(self, body: dict[str, Any]) -> bool:
        """Return whether a reading is new according to its sequence number, if it has one."""
        if "seq" not in body:
            return True
        stream = body["stream"]
        if stream not in self._sequences:
            if len(self._sequences) == MAX_STREAMS:
                self.health.bad += 1
                return False
            self._sequences[stream] = SequenceTracker(_SEQ_SPAN, self.health)
        return self._sequences[stream].accept(body["seq"])


def _sample(body: dict[str, Any], t_ns: int) -> Reading:
    status, stream, time_ns = body.get("status", ()), body["stream"], body["t_ns"]
    if "values" in body:
        values = np.array(body["values"], dtype=np.float64)
        return TactileSample(t_ns, time_ns, values, _with_validity(status, values.ravel()), stream)
    if "gravity_mps2" in body:
        motion = body["gravity_mps2"], body["angular_velocity_radps"], body.get("angular_acceleration_radps2")
        return ArmSample(t_ns, time_ns, *motion, _with_validity(status, *motion), stream)
    if "force_n" in body:
        wrench = body["force_n"], body.get("torque_nm")
        return WrenchSample(t_ns, time_ns, *wrench, _with_validity(status, *wrench), stream)
    pose = body.get("object_pose", {})
    place = pose.get("xyz_m"), pose.get("quat_xyzw")
    speed, std = (float(body[key]) if key in body else None for key in ("object_speed_mps", "object_speed_std_mps"))
    moves = () if speed is None or std is None else (speed, std, speed / std * (speed / std))
    return ObjectSample(t_ns, time_ns, *place, speed, std, _with_validity(status, *place, moves), stream)


def _with_validity(status: tuple[str, ...], *numbers: Sequence[float] | Array | None) -> tuple[str, ...]:
    """Return the status, with "invalid" where a number is not finite."""
    known = np.concatenate([part for part in numbers if part is not None])
    return status if "invalid" in status or np.isfinite(known).all() else (*status, "invalid")


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


FASTEST_HZ = 10_000.0
"""What one socket carries without a backlog, and more than any force sensor sends."""

DEVICE = Device(
    "external",
    "any",
    ("external",),
    Decoder,
    rates_hz=(0.1, FASTEST_HZ),
    shared=True,
    host_clock=True,
    frame="a reading",
    evidence="own",
)
