"""Readings that another process sends: a driver that holds the port of a sensor, a camera, or what moves the arm.

Each reading is one msgpack map; docs/devices.md describes it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from slipd.devices import Device
from slipd.devices.external.external_message import MAX_MESSAGE, encode_reading, read
from slipd.devices.shared.frame_scanner import FrameDecoder, MessageScanner
from slipd.devices.shared.sequence_tracker import SequenceTracker
from slipd.types.arrays import Array
from slipd.types.samples import ArmSample, ObjectSample, TactileSample, WrenchSample

__all__ = ["DEVICE", "MAX_MESSAGE", "MAX_STREAMS", "Decoder", "encode_reading"]

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

    Status names: those of the message, and "invalid" if a value is not finite.
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
    status, stream, time_ns = tuple(body.get("status", ())), body["stream"], body["t_ns"]
    if "values" in body:
        values = np.array(body["values"], dtype=np.float64)
        return TactileSample(t_ns, time_ns, values, _with_validity(status, values.ravel()), stream)
    if "gravity_mps2" in body:
        return _arm_sample(body, t_ns, status)
    if "force_n" not in body:
        return _object_sample(body, t_ns, status)
    force_n, torque_nm = _floats(body["force_n"]), _optional(body.get("torque_nm"))
    status = _with_validity(status, force_n, torque_nm)
    return WrenchSample(t_ns, time_ns, force_n, torque_nm, status, stream)


def _object_sample(body: dict[str, Any], t_ns: int, status: tuple[str, ...]) -> ObjectSample:
    pose = body.get("object_pose", {})
    xyz_m, quat_xyzw = _optional(pose.get("xyz_m")), _optional(pose.get("quat_xyzw"))
    speed, std = (float(body[key]) if key in body else None for key in ("object_speed_mps", "object_speed_std_mps"))
    status = _with_validity(status, xyz_m, quat_xyzw, () if speed is None or std is None else (speed, std))
    return ObjectSample(t_ns, body["t_ns"], xyz_m, quat_xyzw, speed, std, status, body["stream"])


def _arm_sample(body: dict[str, Any], t_ns: int, status: tuple[str, ...]) -> ArmSample:
    gravity_mps2, velocity_radps = _floats(body["gravity_mps2"]), _floats(body["angular_velocity_radps"])
    acceleration_radps2 = _optional(body.get("angular_acceleration_radps2"))
    status = _with_validity(status, gravity_mps2, velocity_radps, acceleration_radps2)
    return ArmSample(t_ns, body["t_ns"], gravity_mps2, velocity_radps, acceleration_radps2, status, body["stream"])


def _floats(values: Sequence[float]) -> tuple[float, ...]:
    return tuple(map(float, values))


def _optional(values: Sequence[float] | None) -> tuple[float, ...] | None:
    return None if values is None else _floats(values)


def _with_validity(status: tuple[str, ...], *numbers: Sequence[float] | Array | None) -> tuple[str, ...]:
    """Return the status, with "invalid" where a number is not finite."""
    known = np.concatenate([part for part in numbers if part is not None])
    return status if "invalid" in status or np.isfinite(known).all() else (*status, "invalid")


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
