"""Frames of the bed's devices changed on their way, and made whole again: what a faulty device would send."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence

import numpy as np

from slipd.devices import bota
from slipd.devices.bota import FRAME_LENGTH
from slipd.devices.shared import checksums

_BOTA = struct.Struct("<BH6fIf")
_PVDF_HEAD = 12
_COLUMNS = 16
_CLOCK_AT = 6
_US_SPAN = 1 << 32
_REPLY_LENGTH = 11

Reading = list[float]
WrenchChange = Callable[[Reading, int], Sequence[float]]
RowChange = Callable[[int, np.ndarray, int], np.ndarray]
Bytewise = Callable[[bytes, int], bytes]


def wrench(
    change: WrenchChange | None = None, *, status: int = 0, clock_us: Callable[[int], int] | None = None
) -> Bytewise:
    """Changes the frames of a force/torque sensor; texts pass.

    Args:
        change: ``change(six, now_ns)`` returns the six components to send instead, N and N·m.
        status: Bits that are set besides.
        clock_us: Makes of the device's time the one that is sent instead, µs.
    """

    def edited(data: bytes, now_ns: int) -> bytes:
        if len(data) % FRAME_LENGTH or not data.startswith(b"\xaa"):
            return data
        frames = []
        for at in range(0, len(data), FRAME_LENGTH):
            _, bits, *six, time_us, temperature_c = _BOTA.unpack_from(data, at)
            said = list(six) if change is None else list(change(list(six), now_ns))
            sent_us = time_us if clock_us is None else clock_us(time_us)
            frames.append(
                bota.encode_frame(said[:3], said[3:], sent_us, temperature_c=temperature_c, status=bits | status)
            )
        return b"".join(frames)

    return edited


def pad(change: RowChange | None = None, *, clock_us: Callable[[int], int] | None = None) -> Bytewise:
    """Changes the rows of a pad's scans.

    Args:
        change: ``change(row, counts, now_ns)`` returns the counts to send instead, shape (columns,).
        clock_us: Makes of the device's time the one that is sent instead, µs.
    """

    def edited(data: bytes, now_ns: int) -> bytes:
        frames = []
        for frame in rows_of(data):
            if clock_us is not None:
                (time_us,) = struct.unpack_from("<I", frame, _CLOCK_AT)
                struct.pack_into("<I", frame, _CLOCK_AT, clock_us(time_us) % _US_SPAN)
            if change is not None:
                counts = np.frombuffer(bytes(frame[_PVDF_HEAD:]), "<i2").astype(np.int64)
                said = np.clip(change(frame[3], counts, now_ns), -32_768, 32_767)
                frame[_PVDF_HEAD:] = said.astype("<i2").tobytes()
            frames.append(sealed(frame))
        return b"".join(frames)

    return edited


def rows_of(data: bytes) -> list[bytearray]:
    """Return the rows of a pad's scans without their checksums."""
    length = _PVDF_HEAD + 2 * _COLUMNS + 2
    return [bytearray(data[at : at + length - 2]) for at in range(0, len(data), length)]


def sealed(row: bytes) -> bytes:
    """Return a row with its checksum."""
    return bytes(row) + checksums.x25(bytes(row[2:])).to_bytes(2, "little")


def gripper(change: Callable[[bytearray], None]) -> Bytewise:
    """Changes the six status bytes of each status reply of the gripper; its other answers pass.

    Args:
        change: Changes the bytes: status, reserved, fault, requested position, position, current.
    """

    def edited(data: bytes, _: int) -> bytes:
        if len(data) != _REPLY_LENGTH or data[1:3] not in (b"\x03\x06", b"\x04\x06"):
            return data
        status = bytearray(data[3:9])
        change(status)
        body = data[:3] + bytes(status)
        return body + checksums.modbus(body).to_bytes(2, "little")

    return edited


class Frozen:
    """Holds the first counts or components it sees; the clock and the count go on."""

    def __init__(self) -> None:
        self._first: dict[int, np.ndarray] = {}

    def row(self, row: int, counts: np.ndarray, _: int) -> np.ndarray:
        """For `pad`."""
        return self._first.setdefault(row, counts)

    def reading(self, six: Reading, _: int) -> Sequence[float]:
        """For `wrench`."""
        return self._first.setdefault(0, np.array(six)).tolist()
