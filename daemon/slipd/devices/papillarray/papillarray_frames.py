"""Frames of a Contactile PTS controller: byte layout and parser.

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
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from slipd.devices.shared.frame_scanner import NO_FRAME
from slipd.devices.shared.msgpack_messages import Incomplete, Malformed, arrived
from slipd.types.arrays import Array

START = b"\x55\x66\x77\x88"
END = b"\xaa\xbb\xcc\xdd"

SENSORS, PILLARS = 2, 9
"""Largest numbers of sensors per controller, and of pillars per sensor (three by three)."""

LONGEST = 1024
"""Longest frame, bytes; all blocks of two sensors with the widest offsets fill 915."""

HUB, PILLAR_FORCES, TOTALS, PILLAR_SLIP, SENSOR_SLIP, UNDEFINED = 1, 3, 4, 5, 6, 7
"""Types of a block."""

_WIDTHS = (1, 2, 4)  # of an offset, bytes
INDEX_END = b"\0\0"
VECTORS_FIELDS = struct.Struct("<H6f")  # entry type, six numbers
VECTORS_TYPE = 2
PILLAR_SLIP_FIELDS = struct.Struct("<Hbf")  # entry type, state of slip, friction
SENSOR_SLIP_FIELDS = struct.Struct("<HBff")  # entry type, state of the detection, friction, grip force it asks for, N
SLIP_TYPE = 1
HUB_FIELDS = struct.Struct("<IQ")  # frame counter, device time in µs
_LATEST_US = 1 << 53  # 285 years
_ENTRIES = np.dtype([("type", "<u2"), ("force_n", "<f4", 3), ("displacement_mm", "<f4", 3)])
SUM_LENGTH = 2


_FindEnd = Callable[[bytes, int, int], int]
"""``find_end(body, at, width)`` returns where the item at ``at`` ends; raises `Incomplete` or `Malformed`."""


@dataclass(frozen=True, slots=True)
class Body:
    """Content of a frame.

    Attributes:
        counter: Sequence number of the frame.
        time_us: Device time, µs.
        forces_n: For each sensor the force on its pillars, N, shape (pillars, 3); None for a sensor without pillars.
    """

    counter: int
    time_us: int
    forces_n: list[Array | None]


def parse(buffer: bytes, at: int) -> tuple[int, Body | None]:
    """Return length and content of the valid frame at ``at``.

    If there is none, the content is None, and the length is 0 if more bytes may complete a frame, else `NO_FRAME`.
    """
    begin = at + len(START)
    closed = buffer.find(END + START, begin, at + LONGEST + len(START))
    body = buffer[begin : at + LONGEST if closed < 0 else closed + len(END)]
    try:
        blocks, end = _blocks(body)
    except Malformed:
        return NO_FRAME, None
    except Incomplete:
        return (0 if closed < 0 and len(buffer) < at + LONGEST else NO_FRAME), None
    counter, time_us = HUB_FIELDS.unpack_from(body, blocks[HUB])
    return len(START) + end + SUM_LENGTH + len(END), Body(counter, time_us, _forces_n(body, blocks))


def _forces_n(body: bytes, blocks: dict[int, int]) -> list[Array | None]:
    """Return the forces on the pillars, sensor by sensor."""
    if PILLAR_FORCES not in blocks:
        return []
    width, array = body[0], blocks[PILLAR_FORCES]
    forces_n: list[Array | None] = []
    for sensor in range(_count(body, array)):
        begin = _number(body, array + 2 + sensor * width, width)
        pillars = _count(body, begin)
        entries = np.frombuffer(body, _ENTRIES, pillars, begin + 2 + pillars * width)
        forces_n.append(entries["force_n"].astype(np.float64) if pillars else None)
    return forces_n


def _blocks(body: bytes) -> tuple[dict[int, int], int]:
    """Return where each block begins, by type, and where the last one ends."""
    width = body[arrived(body, 1) - 1]
    if width not in _WIDTHS:
        raise Malformed
    entry = 2 + width
    count, rest = divmod(_number(body, 3, width) - 1, entry)
    table_end = 1 + count * entry
    if not 1 <= count <= UNDEFINED or rest != len(INDEX_END):
        raise Malformed
    if body[table_end : arrived(body, table_end + rest)] != INDEX_END:
        raise Malformed
    begins = {_count(body, at): _number(body, at + 2, width) for at in range(1, table_end, entry)}
    if HUB not in begins or len(begins) < count:
        raise Malformed
    end = table_end + rest
    for (kind, begin), follower in zip(begins.items(), [*list(begins.values())[1:], None], strict=True):
        end = _block_end(body, kind, begin, follower)
    return begins, end


def _block_end(body: bytes, kind: int, begin: int, follower: int | None) -> int:
    """Return where a block ends: at the beginning of the next one, or before the sum and the end marker."""
    if kind == UNDEFINED:
        if follower is None:
            return _found_end(body, begin)
        if follower < begin:
            raise Malformed
        return follower
    if kind not in _FIND_ENDS:
        raise Malformed
    end = _FIND_ENDS[kind](body, begin, body[0])
    if end == follower or (follower is None and _is_end(body, end)):
        return end
    raise Malformed


def _is_end(body: bytes, at: int) -> bool:
    """Return whether the blocks end at ``at``, followed by their sum and the end marker."""
    tail = body[at : arrived(body, at + SUM_LENGTH + len(END))]
    return tail.endswith(END) and sum(body[:at]) & 0xFFFF == int.from_bytes(tail[:SUM_LENGTH], "little")


def _found_end(body: bytes, at: int) -> int:
    """Return where the blocks end if only the sum shows it, searching from ``at``."""
    total, counted = 0, 0
    marker = body.find(END, at + SUM_LENGTH)
    while marker >= 0:
        end = marker - SUM_LENGTH
        total, counted = total + sum(body[counted:end]), end
        if total & 0xFFFF == int.from_bytes(body[end:marker], "little"):
            return end
        marker = body.find(END, marker + 1)
    raise Incomplete


def _number(body: bytes, at: int, width: int) -> int:
    return int.from_bytes(body[at : arrived(body, at + width)], "little")


def _count(body: bytes, at: int) -> int:
    return _number(body, at, 2)


def _entry(kind: int, size: int) -> _FindEnd:
    """Return the function that finds the end of an entry that begins with its type."""

    def find_end(body: bytes, at: int, width: int) -> int:
        if _count(body, at) != kind:
            raise Malformed
        return arrived(body, at + size)

    return find_end


def _array(most: int, item_end: _FindEnd) -> _FindEnd:
    """Return the function that finds the end of an array: count, offset of each item, items."""

    def find_end(body: bytes, at: int, width: int) -> int:
        count = _count(body, at)
        if count > most:
            raise Malformed
        place, end = at + 2, at + 2 + count * width
        for _ in range(count):
            if _number(body, place, width) != end:
                raise Malformed
            place += width
            end = item_end(body, end, width)
        return end

    return find_end


def _hub(body: bytes, at: int, width: int) -> int:
    end = arrived(body, at + HUB_FIELDS.size)
    if _number(body, at + 4, 8) >= _LATEST_US:
        raise Malformed
    return end


_FIND_ENDS: dict[int, _FindEnd] = {
    HUB: _hub,
    PILLAR_FORCES: _array(SENSORS, _array(PILLARS, _entry(VECTORS_TYPE, VECTORS_FIELDS.size))),
    TOTALS: _array(SENSORS, _entry(VECTORS_TYPE, VECTORS_FIELDS.size)),
    PILLAR_SLIP: _array(SENSORS, _array(PILLARS, _entry(SLIP_TYPE, PILLAR_SLIP_FIELDS.size))),
    SENSOR_SLIP: _array(SENSORS, _entry(SLIP_TYPE, SENSOR_SLIP_FIELDS.size)),
}
"""For each type of block, the function that finds its end."""
