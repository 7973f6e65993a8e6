"""Contactile PapillArray pads behind a PTS controller: nine three-axis pillars per sensor, two sensors per port.

The controller streams without a request; the session only sets its rate. It never sends the command that zeroes the
sensors, because slipd's own tares are reversible.

A frame, little-endian: ``55 66 77 88``, width of an offset (u8), an index of blocks (type u16, offset) that ends with
the type 0, the blocks, the 16-bit sum of all bytes after the start marker, ``AA BB CC DD``. Blocks contain arrays of
arrays. Every offset, in the index and in the arrays, counts from the byte after the start marker.

A frame has no length and nothing in it is escaped, so the parser follows its offsets: every offset must point to the
end of the previous item, and the last item must be followed by sum and end marker. If the last block has no defined
content, the frame ends at the first end marker at which the sum matches. An end marker directly followed by a start
marker ends the frame in any case.

Source: the maker's parser, ``PTSDKParser::parseDataPacket`` of libPTSDK 2.0 (December 2022), in the public repository
langxin11/tactile_grasp_lab at 7be4d64, ``ros2_ws/src/papillarray_ros2_v2/lib/libPTSDK.a`` (x86-64). It shows the type 0
at the end of the index, the offsets from the start of the packet, force before displacement, and types of two bytes in
all entries. PTSCOM_2.0_SPEC_SEP22 (section 3.2) agrees that "the first byte after the start packet" has index 0.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from slipd.devices import Device, RateOption
from slipd.devices.shared.device_interface import check_choice
from slipd.devices.shared.frame_scanner import NO_FRAME, FrameDecoder, FrameScanner
from slipd.devices.shared.sensor_session import SensorSession, Step
from slipd.devices.shared.sequence_tracker import SequenceTracker
from slipd.types.samples import Sample, TactileSample

START = b"\x55\x66\x77\x88"
END = b"\xaa\xbb\xcc\xdd"

SENSORS, PILLARS = 2, 9
"""Largest numbers of sensors per controller, and of pillars per sensor (three by three)."""

LONGEST = 1024
"""Longest frame, bytes; all blocks of two sensors with the widest offsets fill 915."""

HUB, PILLAR_FORCES, TOTALS, PILLAR_SLIP, SENSOR_SLIP, UNDEFINED = 1, 3, 4, 5, 6, 7
"""Types of a block."""

INDEX_END = b"\0\0"
VECTORS_FIELDS = struct.Struct("<H6f")  # entry type, six numbers
VECTORS_TYPE = 2
PILLAR_SLIP_FIELDS = struct.Struct("<Hbf")  # entry type, state of slip, friction
SENSOR_SLIP_FIELDS = struct.Struct("<HBff")  # entry type, state of the detection, friction, grip force it asks for, N
SLIP_TYPE = 1
HUB_FIELDS = struct.Struct("<IQ")  # frame counter, device time in µs
SUM_LENGTH = 2

_TYPICAL_LENGTH = 640  # two sensors of nine pillars and their totals
_COUNTER_SPAN = 1 << 32
_LATEST_US = 1 << 53  # 285 years
_OFFSET_CODES = {1: "B", 2: "H", 4: "I"}  # of `struct`, by the width of an offset in bytes
_PILLAR = np.dtype([("type", "<u2"), ("force_n", "<f4", 3), ("displacement_mm", "<f4", 3)])

_ENTRIES = {
    PILLAR_FORCES: (VECTORS_TYPE, VECTORS_FIELDS.size),
    TOTALS: (VECTORS_TYPE, VECTORS_FIELDS.size),
    PILLAR_SLIP: (SLIP_TYPE, PILLAR_SLIP_FIELDS.size),
    SENSOR_SLIP: (SLIP_TYPE, SENSOR_SLIP_FIELDS.size),
}
"""Type and length of the entries of each kind of block with arrays."""
_OF_PILLARS = (PILLAR_FORCES, PILLAR_SLIP)
"""Blocks with an array of the pillars of each sensor; the others have one entry for each sensor."""


class _Incomplete(Exception):  # noqa: N818
    """The bytes end before the frame does."""


class _Malformed(Exception):  # noqa: N818
    """There is no valid frame."""


class Decoder(FrameDecoder):
    """Return a tactile sample of every sensor in a frame; ``source`` is its index in the frame, "0" or "1".

    ``values`` has shape (pillars, 3): Fx, Fy, Fz of each pillar in N, in the order, axes and sign that the controller
    sends. ``device_time_ns`` is the controller's clock, which never wraps. The decoder checks the structure of
    displacements, totals and the controller's own slip detection, but does not use them: force and torque follow from
    the pillars' forces.

    `health.lost`, `duplicates` and `restarts` count frames by the controller's counter, `good` counts samples.

    The only status name is "invalid": a value is not finite.

    Attributes:
        frames_found: Number of frames that the bytes received last completed, also of those without sensors.
    """

    def __init__(self) -> None:
        super().__init__()
        self._frames = FrameScanner(START, measure, _TYPICAL_LENGTH, self.health)
        self._sequence = SequenceTracker(_COUNTER_SPAN, self.health, in_order=True)
        self.frames_found = 0

    def _readings(self, data: bytes, t_ns: int) -> list[TactileSample]:
        buffer, found = self._frames.receive(data)
        self.frames_found = len(found)
        return [sample for at, _ in found for sample in self._samples(buffer[at + len(START) :], t_ns)]

    def forget(self) -> None:
        """Drop a partial frame and the expected counter, because the line was closed."""
        super().forget()
        self._sequence.forget()

    def _samples(self, body: bytes, t_ns: int) -> list[TactileSample]:
        """Return the images of a valid frame."""
        blocks, _ = _index(body)
        counter, time_us = HUB_FIELDS.unpack_from(body, blocks[HUB])
        if not self._sequence.accept(counter) or PILLAR_FORCES not in blocks:
            return []
        samples = []
        for sensor, begin in enumerate(_array(body, blocks[PILLAR_FORCES], SENSORS)[0]):
            pillars, first = _array(body, begin, PILLARS)
            if pillars:
                forces_n = np.frombuffer(body, _PILLAR, len(pillars), first)["force_n"].astype(np.float64)
                status = () if np.isfinite(forces_n).all() else ("invalid",)
                samples.append(TactileSample(t_ns, time_us * 1000, forces_n, status, str(sensor)))
        return samples


def measure(buffer: bytes, at: int) -> int:
    """Return the length of the valid frame at ``at``; 0 if more bytes may complete one, else `NO_FRAME`."""
    begin = at + len(START)
    closed = buffer.find(END + START, begin, at + LONGEST + len(START))
    body = buffer[begin : at + LONGEST if closed < 0 else closed + len(END)]
    try:
        return len(START) + _blocks_end(body) + SUM_LENGTH + len(END)
    except _Malformed:
        return NO_FRAME
    except _Incomplete:
        return 0 if closed < 0 and len(buffer) < at + LONGEST else NO_FRAME


def _index(body: bytes) -> tuple[dict[int, int], int]:
    """Return where each block begins, by type in the order of the index, and where the index ends."""
    width = body[_arrived(body, 1) - 1]
    if width not in _OFFSET_CODES:
        raise _Malformed
    entry = struct.Struct(f"<H{_OFFSET_CODES[width]}")  # type and offset
    first_block = entry.unpack_from(body, _arrived(body, 1 + entry.size) - entry.size)[1]
    table_end = first_block - len(INDEX_END)
    count, rest = divmod(table_end - 1, entry.size)
    if rest or not 1 <= count <= UNDEFINED or body[table_end : _arrived(body, first_block)] != INDEX_END:
        raise _Malformed
    begins = dict(entry.iter_unpack(body[1:table_end]))
    if HUB not in begins or len(begins) < count:
        raise _Malformed
    return begins, first_block


def _blocks_end(body: bytes) -> int:
    """Return where the last block ends, before the sum and the end marker."""
    begins, end = _index(body)
    before = HUB
    for kind, begin in begins.items():
        if begin != end and (before != UNDEFINED or begin < end):
            raise _Malformed
        before, end = kind, _block_end(body, kind, begin)
    if _is_end(body, end):
        return end
    if before != UNDEFINED:
        raise _Malformed
    total, counted = 0, 0
    marker = body.find(END, end + SUM_LENGTH)
    while marker >= 0:
        end = marker - SUM_LENGTH
        total, counted = total + sum(body[counted:end]), end
        if total & 0xFFFF == int.from_bytes(body[end:marker], "little"):
            return end
        marker = body.find(END, marker + 1)
    raise _Incomplete


def _is_end(body: bytes, at: int) -> bool:
    """Return whether the blocks end at ``at``, followed by their sum and the end marker."""
    tail = body[at : _arrived(body, at + SUM_LENGTH + len(END))]
    return tail.endswith(END) and sum(body[:at]) & 0xFFFF == int.from_bytes(tail[:SUM_LENGTH], "little")


def _block_end(body: bytes, kind: int, at: int) -> int:
    """Return where the block at ``at`` ends; of an undefined one, where it begins."""
    if kind == UNDEFINED:
        return at
    if kind == HUB:
        end = _arrived(body, at + HUB_FIELDS.size)
        if HUB_FIELDS.unpack_from(body, at)[1] >= _LATEST_US:
            raise _Malformed
        return end
    if kind not in _ENTRIES:
        raise _Malformed
    if kind not in _OF_PILLARS:
        return _entries_end(body, at, SENSORS, *_ENTRIES[kind])
    offsets, end = _array(body, at, SENSORS)
    for offset in offsets:
        if offset != end:
            raise _Malformed
        end = _entries_end(body, end, PILLARS, *_ENTRIES[kind])
    return end


def _entries_end(body: bytes, at: int, most: int, entry_type: int, size: int) -> int:
    """Return where an array of entries ends, each of which begins with its type and has ``size`` bytes."""
    offsets, first = _array(body, at, most)
    count = len(offsets)
    end = first + count * size
    if offsets != tuple(range(first, end, size)):
        raise _Malformed
    types = body[first : _arrived(body, end) : size] + body[first + 1 : end : size]
    if types != bytes((entry_type,)) * count + bytes(count):
        raise _Malformed
    return end


def _array(body: bytes, at: int, most: int) -> tuple[tuple[int, ...], int]:
    """Return the offset of each item of the array at ``at``, and where the first item begins."""
    count = int.from_bytes(body[at : _arrived(body, at + 2)], "little")
    if count > most:
        raise _Malformed
    first = _arrived(body, at + 2 + count * body[0])
    return struct.unpack_from(f"<{count}{_OFFSET_CODES[body[0]]}", body, at + 2), first


def _arrived(body: bytes, end: int) -> int:
    """Return ``end`` if all bytes before it have arrived."""
    if end > len(body):
        raise _Incomplete
    return end


RATES_HZ = (100, 250, 500, 1000)


class Session(SensorSession[Decoder]):
    """Set the controller's rate, and set it again whenever the stream falls silent.

    `state` is "closed", "waiting", "running" or "no answer to rate". The controller does not identify itself, so
    `identity` is "".

    Args:
        rate_hz: Frames per second: 100, 250, 500 or 1000.

    Raises:
        ValueError: The rate is not one of these.
    """

    def __init__(self, rate_hz: int = 500) -> None:
        check_choice("rate_hz", rate_hz, RATES_HZ)
        # There is no last request, because the controller has no command that stops it.
        super().__init__(Decoder(), [Step("rate", f"f{rate_hz}\n".encode(), "none")])

    def receive(self, data: bytes, now_ns: int) -> Sequence[Sample]:
        """Decode bytes received at ``now_ns``; return the images they complete."""
        samples = super().receive(data, now_ns)
        if self.decoder.frames_found:  # the controller sends, even if no sensor is connected
            self.reading_received(now_ns)
        return samples


DEVICE = Device(
    "papillarray",
    "tactile",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(RATES_HZ[0], RATES_HZ[-1]),
    baud=115_200,
    axes=3,
    measures_newtons=True,
    taxels=PILLARS,
    shared=True,
    sensors=tuple(map(str, range(SENSORS))),
    rate_option=RateOption("rate_hz"),
    frame="a PTS frame",
    evidence="maker",
)
