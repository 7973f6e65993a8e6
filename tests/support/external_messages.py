"""Messages of another process, packed by hand and decoded."""

from __future__ import annotations

from typing import Any

import msgpack

from slipd.devices import external
from slipd.devices.external import encode_reading
from slipd.types.samples import ObjectSample, TactileSample, WrenchSample

WRENCH = {"stream": "left.wrench", "t_ns": 5, "force_n": [1.0, 2.0, 3.0], "torque_nm": [0.1, 0.2, 0.3]}
IMAGE = {"stream": "left.pad", "t_ns": 6, "values": [1.0, 2.0, 3.0, 4.0]}


def decode(*messages: bytes) -> tuple[list[WrenchSample | TactileSample | ObjectSample], external.Decoder]:
    decoder = external.Decoder()
    return decoder.receive(b"".join(messages), 77), decoder


def pack(base: dict[str, Any], **changes: Any) -> bytes:
    """Return a message with changed fields; ``...`` removes a field."""
    data: bytes = msgpack.packb({key: value for key, value in {**base, **changes}.items() if value is not ...})
    return data


def wrench(number: int) -> bytes:
    return encode_reading("w", number, force_n=(number, 0, -1), torque_nm=(0, 0, 0.5))


def times(samples: list[WrenchSample | TactileSample | ObjectSample]) -> list[int | None]:
    return [sample.device_time_ns for sample in samples]
