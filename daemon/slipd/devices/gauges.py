"""Raw strain gauges: six channels behind one amplifier on a serial line, converted to a wrench by a 6×6 matrix.

The paper's own force sensor is such a beam with six strain gauges. The paper describes no wire format; this one is
slipd's own. docs/devices.md describes it with a worked frame.

A frame has 36 bytes, little-endian: ``C3 3C``, version 1 (u8), status (u8), sequence number (u16), device time in µs
(u32), six counts (i32), CRC-16/X-25 of everything after ``C3 3C`` (u16).
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from slipd.devices import Device, Need
from slipd.devices.shared import checksums
from slipd.devices.shared.frame_scanner import NO_FRAME, FrameDecoder, FrameScanner
from slipd.devices.shared.sequence_tracker import SequenceTracker
from slipd.types.arrays import Array
from slipd.types.samples import WrenchSample

CHANNELS = 6
FRAME_LENGTH = 36

LARGEST_ENTRY = 1e6
"""Largest matrix entry, N or N·m per count: far beyond any gauge, and the sum of six products stays finite."""
LARGEST_OFFSET = 2.0**32
"""Largest offset, counts: the span of a count of 32 bits."""
LARGEST_CONDITION = 1e6
"""Largest condition number of the matrix with rows of length one; beyond it the channels are hardly independent."""

_VERSION = 1
_SYNC = bytes((0xC3, 0x3C, _VERSION))
_UNCHECKED = 2  # bytes before the version, where the checksum begins
_BODY = struct.Struct("<BHI6i")  # status, sequence, device time µs, counts
_RESERVED_STATUS = 0x80
_SATURATED = (1 << CHANNELS) - 1
_INVALID = 1 << CHANNELS
_RAILS = frozenset((-(1 << 31), (1 << 31) - 1))
_SEQUENCE_SPAN = 1 << 16
_US_SPAN = 1 << 32
_measure_sum = checksums.x25_measure(_UNCHECKED, FRAME_LENGTH)


class Decoder(FrameDecoder):
    """Decode frames to wrench samples: wrench = matrix · (counts − offset).

    ``device_time_ns`` is the amplifier's microsecond counter as sent: it wraps every 2^32 µs (71.6 min) and is not
    unwrapped here. `health.lost` counts the gaps in the sequence numbers.

    Status names: "overload" (a channel is saturated, or its count is at the end of its range), "invalid" (the amplifier
    reports that no channel can be trusted, for example because a bridge has no supply).

    Args:
        matrix: Six rows (force x y z in N per count, torque x y z in N·m per count) by six channels; by default the
            identity.
        offset: Counts of each channel without load.

    Raises:
        ValueError: Matrix or offset has a wrong shape, is not finite or too large, or the matrix is (nearly) singular.
    """

    def __init__(
        self, matrix: Sequence[Sequence[float]] | None = None, offset: Sequence[float] = (0.0,) * CHANNELS
    ) -> None:
        self._matrix = np.eye(CHANNELS) if matrix is None else _checked_matrix(matrix)
        self._offset = _array("offset", offset, (CHANNELS,), LARGEST_OFFSET)
        super().__init__()
        self._sequence = SequenceTracker(_SEQUENCE_SPAN, self.health, in_order=True)
        self._frames = FrameScanner(_SYNC, _measure, FRAME_LENGTH, self.health, least=FRAME_LENGTH)

    def _readings(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        buffer, found = self._frames.receive(data, t_ns)
        samples: list[WrenchSample] = []
        for at, _ in found:
            status, sequence, time_us, *counts = _BODY.unpack_from(buffer, at + len(_SYNC))
            if not self._sequence.accept(sequence):
                continue
            values = (self._matrix @ (np.array(counts) - self._offset)).tolist()
            words = ("overload",) if status & _SATURATED or not _RAILS.isdisjoint(counts) else ()
            if status & _INVALID:
                words = (*words, "invalid")
            samples.append(WrenchSample(t_ns, time_us * 1000, values[:3], values[3:], words))
        return samples

    def forget(self) -> None:
        """Drop a partial frame and the expected sequence number, because the line was closed."""
        super().forget()
        self._sequence.forget()


def _measure(buffer: bytes, at: int) -> int:
    return NO_FRAME if buffer[at + len(_SYNC)] & _RESERVED_STATUS else _measure_sum(buffer, at)


def _checked_matrix(rows: Sequence[Sequence[float]]) -> Array:
    matrix = _array("matrix", rows, (CHANNELS, CHANNELS), LARGEST_ENTRY)
    lengths = np.linalg.norm(matrix, axis=1, keepdims=True)
    condition = np.linalg.cond(matrix / lengths) if lengths.all() else np.inf
    if condition > LARGEST_CONDITION:
        raise ValueError(
            f"matrix must not be (nearly) singular: its condition number with rows of length one must be at most "
            f"{LARGEST_CONDITION:.0e}, got {condition:.1e}"
        )
    return matrix


def _array(
    name: str, numbers: Sequence[float] | Sequence[Sequence[float]], shape: tuple[int, ...], most: float
) -> Array:
    try:
        array = np.array(numbers, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    if array.shape != shape or not (np.abs(array) <= most).all():
        size = " x ".join(map(str, shape))
        raise ValueError(f"{name} must be {size} finite numbers, none beyond {most:g}")
    return array


def encode_frame(counts: Sequence[int], sequence: int, device_time_us: int, status: int = 0) -> bytes:
    """Return one frame of 36 bytes as the amplifier sends it.

    Args:
        counts: Six counts, each within an int32.
        sequence: Sequence number; sent modulo 2^16.
        device_time_us: Device time, µs; sent modulo 2^32.
        status: Bits 0 to 5: that channel is saturated; bit 6: no channel can be trusted.
    """
    body = _SYNC + _BODY.pack(status, sequence % _SEQUENCE_SPAN, device_time_us % _US_SPAN, *counts)
    return body + checksums.x25(body[_UNCHECKED:]).to_bytes(2, "little")


DEVICE = Device(
    "gauges",
    "wrench",
    ("serial",),
    Decoder,
    rates_hz=(1.0, 10_000.0),
    baud=921_600,
    frame_bytes=FRAME_LENGTH,
    clock_span_ns=_US_SPAN * 1_000,
    needs=(
        Need(
            "options.matrix",
            "",
            "N and N·m per count of each channel, from known loads in six directions; without it, readings are counts",
            scales=True,
        ),
    ),
    frame="a frame of strain gauges",
    evidence="own",
)
