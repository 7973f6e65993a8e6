"""Frames of a Contactile PTS controller: byte layout, parser and encoders.

A frame, little-endian: ``55 66 77 88``, width of an offset (u8), an index of blocks (type u16, offset), the blocks, the
16-bit sum of all bytes after the start marker, ``AA BB CC DD``. Blocks contain arrays of arrays.

A frame has no length and nothing in it is escaped, so the parser follows its offsets: every offset must point to the
end of the previous item, and the last item must be followed by sum and end marker. If the last block has no defined
content, the frame ends at the first end marker at which the sum matches. An end marker directly followed by a start
marker ends the frame in any case.

Sources: the vendor's PTSCOM 2.0 (September 2022), and a public parser that contradicts it. The offsets of each frame
show whether two zero bytes end the index, and whether the type of a sensor's slip entry has one byte or two.
`papillarray_layout` finds out which numbers are forces.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slipd.arrays import Array
from slipd.devices.shared.partial_message import Incomplete, Malformed, arrived

START = b"\x55\x66\x77\x88"
END = b"\xaa\xbb\xcc\xdd"

SENSORS, PILLARS = 2, 9
"""Largest numbers of sensors per controller, and of pillars per sensor (three by three)."""

LONGEST = 1024
"""Longest frame, bytes; all blocks of two sensors with the widest offsets fill 915."""

HUB, PILLAR_FORCES, TOTALS, PILLAR_SLIP, SENSOR_SLIP, UNDEFINED = 1, 3, 4, 5, 6, 7
"""Types of a block."""

_WIDTHS = (1, 2, 4)  # of an offset, bytes
_INDEX_END = b"\0\0"
_VECTORS = struct.Struct("<H6f")  # entry type, six numbers
_VECTORS_TYPE = 2
_PILLAR_SLIP = struct.Struct("<Hbf")
_SENSOR_SLIP = {1: struct.Struct("<Bbff"), 2: struct.Struct("<Hbff")}  # by the bytes of the type
_SLIP_TYPE = 1
_HUB = struct.Struct("<IQ")  # frame counter, device time in µs
_LATEST_US = 1 << 53  # 285 years
_ENTRIES = np.dtype([("type", "<u2"), ("numbers", "<f4", 6)])
_SUM_LENGTH = 2

_FindEnd = Callable[[bytes, int, int], int]
"""``find_end(body, at, width)`` returns where the item at ``at`` ends; raises `Incomplete` or `Malformed`."""


@dataclass(frozen=True, slots=True, eq=False)
class Pad:
    """Content of a frame for one sensor.

    Attributes:
        entries: Six numbers per pillar, shape (pillars, 6): force, N, and displacement, mm, in one order or the other.
        total_n: Total force of the sensor, N; None if the frame has none.
    """

    entries: Array
    total_n: list[float] | None


@dataclass(frozen=True, slots=True)
class Body:
    """Content of a frame.

    Attributes:
        counter: Sequence number of the frame.
        time_us: Device time, µs.
        pads: Content for each sensor; None for a sensor without pillars.
    """

    counter: int
    time_us: int
    pads: list[Pad | None]


def parse(buffer: bytes, at: int) -> tuple[int, Body | None]:
    """Return length and content of the valid frame at ``at``.

    If there is none, the content is None, and the length is 0 if more bytes may complete a frame, -1 if they cannot.
    """
    begin = at + len(START)
    closed = buffer.find(END + START, begin, at + LONGEST + len(START))
    body = buffer[begin : at + LONGEST if closed < 0 else closed + len(END)]
    try:
        blocks, end = _blocks(body)
    except Malformed:
        return -1, None
    except Incomplete:
        return (0 if closed < 0 and len(buffer) < at + LONGEST else -1), None
    counter, time_us = _HUB.unpack_from(body, blocks[HUB])
    return len(START) + end + _SUM_LENGTH + len(END), Body(counter, time_us, _pads(body, blocks))


def _pads(body: bytes, blocks: dict[int, int]) -> list[Pad | None]:
    """Return the content of the blocks, sensor by sensor."""
    if PILLAR_FORCES not in blocks:
        return []
    totals_n = [_VECTORS.unpack_from(body, place)[1:4] for place in _items(body, blocks.get(TOTALS))]
    sensors = _items(body, blocks[PILLAR_FORCES])
    pads: list[Pad | None] = []
    for sensor, begin in enumerate(sensors):
        pillars = _count(body, begin)
        if not pillars:
            pads.append(None)
            continue
        entries = np.frombuffer(body, _ENTRIES, pillars, begin + 2 + pillars * body[0])["numbers"].astype(np.float64)
        pads.append(Pad(entries, list(totals_n[sensor]) if len(totals_n) == len(sensors) else None))
    return pads


def _items(body: bytes, array: int | None) -> list[int]:
    """Return where each item of a checked array begins; nothing if there is no array."""
    if array is None:
        return []
    width = body[0]
    return [array + _number(body, array + 2 + item * width, width) for item in range(_count(body, array))]


def _blocks(body: bytes) -> tuple[dict[int, int], int]:
    """Return where each block begins, by type, and where the last one ends."""
    width = body[arrived(body, 1) - 1]
    if width not in _WIDTHS:
        raise Malformed
    entry = 2 + width
    count, rest = divmod(_number(body, 3, width) - 1, entry)
    if not 1 <= count <= UNDEFINED or rest not in (0, len(_INDEX_END)):
        raise Malformed
    table_end = 1 + count * entry
    if body[table_end : arrived(body, table_end + rest)] != _INDEX_END[:rest]:
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
    failure: type[Exception] = Malformed
    for find_end in _FIND_ENDS.get(kind, ()):
        try:
            end = find_end(body, begin, body[0])
            if end == follower or (follower is None and _is_end(body, end)):
                return end
        except Incomplete:
            failure = Incomplete
        except Malformed:
            pass
    raise failure


def _is_end(body: bytes, at: int) -> bool:
    """Return whether the blocks end at ``at``, followed by their sum and the end marker."""
    tail = body[at : arrived(body, at + _SUM_LENGTH + len(END))]
    return tail.endswith(END) and sum(body[:at]) & 0xFFFF == int.from_bytes(tail[:_SUM_LENGTH], "little")


def _found_end(body: bytes, at: int) -> int:
    """Return where the blocks end if only the sum shows it, searching from ``at``."""
    total, counted = 0, 0
    marker = body.find(END, at + _SUM_LENGTH)
    while marker >= 0:
        end = marker - _SUM_LENGTH
        total, counted = total + sum(body[counted:end]), end
        if total & 0xFFFF == int.from_bytes(body[end:marker], "little"):
            return end
        marker = body.find(END, marker + 1)
    raise Incomplete


def _number(body: bytes, at: int, width: int) -> int:
    return int.from_bytes(body[at : arrived(body, at + width)], "little")


def _count(body: bytes, at: int) -> int:
    return _number(body, at, 2)


def _entry(kind: int, size: int, type_bytes: int = 2) -> _FindEnd:
    """Return the function that finds the end of an entry that begins with its type."""

    def find_end(body: bytes, at: int, width: int) -> int:
        if _number(body, at, type_bytes) != kind:
            raise Malformed
        return arrived(body, at + size)

    return find_end


def _array(most: int, item_end: _FindEnd) -> _FindEnd:
    """Return the function that finds the end of an array: count, offset of each item from the array's start, items."""

    def find_end(body: bytes, at: int, width: int) -> int:
        count = _count(body, at)
        if count > most:
            raise Malformed
        place, end = at + 2, at + 2 + count * width
        for _ in range(count):
            if _number(body, place, width) != end - at:
                raise Malformed
            place += width
            end = item_end(body, end, width)
        return end

    return find_end


def _hub(body: bytes, at: int, width: int) -> int:
    end = arrived(body, at + _HUB.size)
    if _number(body, at + 4, 8) >= _LATEST_US:
        raise Malformed
    return end


_FIND_ENDS: dict[int, tuple[_FindEnd, ...]] = {
    HUB: (_hub,),
    PILLAR_FORCES: (_array(SENSORS, _array(PILLARS, _entry(_VECTORS_TYPE, _VECTORS.size))),),
    TOTALS: (_array(SENSORS, _entry(_VECTORS_TYPE, _VECTORS.size)),),
    PILLAR_SLIP: (_array(SENSORS, _array(PILLARS, _entry(_SLIP_TYPE, _PILLAR_SLIP.size))),),
    SENSOR_SLIP: tuple(_array(SENSORS, _entry(_SLIP_TYPE, form.size, n)) for n, form in _SENSOR_SLIP.items()),
}
"""For each type of block, the functions that find the end of its possible forms."""


def encode_blocks(blocks: Sequence[tuple[int, bytes]], width: int = 2, *, index_end: bool = True) -> bytes:
    """Return a frame of blocks, each with its type.

    Args:
        blocks: Type and content of each.
        width: Bytes of an offset.
        index_end: Whether two zero bytes end the index, as in PTSCOM 2.0.
    """
    ending = _INDEX_END if index_end else b""
    at = 1 + len(blocks) * (2 + width) + len(ending)
    index = bytes((width,))
    for kind, block in blocks:
        index += kind.to_bytes(2, "little") + at.to_bytes(width, "little")
        at += len(block)
    body = index + ending + b"".join(block for _, block in blocks)
    return START + body + (sum(body) & 0xFFFF).to_bytes(_SUM_LENGTH, "little") + END


def encode_hub(counter: int, time_us: int) -> tuple[int, bytes]:
    """Return the block with sequence number and device time; the counter is sent modulo 2^32."""
    return HUB, _HUB.pack(counter % (1 << 32), time_us)


def encode_array(items: Sequence[bytes], width: int = 2) -> bytes:
    """Return an array of items."""
    at = 2 + len(items) * width
    table = len(items).to_bytes(2, "little")
    for item in items:
        table += at.to_bytes(width, "little")
        at += len(item)
    return table + b"".join(items)


def encode_vectors(first: Array | Sequence[float], second: Array | Sequence[float]) -> bytes:
    """Return an entry of two vectors, each of shape (3,)."""
    return _VECTORS.pack(_VECTORS_TYPE, *first, *second)


def encode_pillars(pads: Sequence[Array | Sequence[Sequence[float]]], width: int = 2) -> tuple[int, bytes]:
    """Return the block of the pillars: six numbers per pillar of each sensor, in the order of the layout."""
    sensors = [encode_array([encode_vectors(pillar[:3], pillar[3:]) for pillar in pad], width) for pad in pads]
    return PILLAR_FORCES, encode_array(sensors, width)


def encode_totals(totals: Sequence[NDArray[np.float64] | Sequence[float]], width: int = 2) -> tuple[int, bytes]:
    """Return the block of the total force of each sensor, N, shape (3,); its torques are zero."""
    return TOTALS, encode_array([encode_vectors(total, (0, 0, 0)) for total in totals], width)


def encode_slip(pillars: Sequence[int], width: int = 2, *, type_bytes: int = 1) -> list[tuple[int, bytes]]:
    """Return the two blocks of a slip detection that is switched off.

    Args:
        pillars: Number of pillars of each sensor.
        width: Bytes of an offset.
        type_bytes: Bytes of the type in a sensor's entry: 1, as in PTSCOM 2.0, or 2.
    """
    idle = _PILLAR_SLIP.pack(_SLIP_TYPE, 0, 0.0)
    off = _SENSOR_SLIP[type_bytes].pack(_SLIP_TYPE, 0, 0.0, -1.0)
    per_pillar = encode_array([encode_array([idle] * count, width) for count in pillars], width)
    return [(PILLAR_SLIP, per_pillar), (SENSOR_SLIP, encode_array([off] * len(pillars), width))]
