"""The frames of a Contactile PTS controller: markers, a sum, an index of blocks, and arrays of arrays behind it.

A frame has no length and nothing in it is escaped, so its index is walked: every offset must point at what lies behind
the thing before it, and behind the last thing stand the sum and the end marker. Where a block without a form is the
last one, the frame ends at the first end marker at which the sum holds. An end marker that a start marker follows
directly ends the frame in any case.
Sources, little-endian: the vendor's PTSCOM 2.0 (September 2022), and a public parser that contradicts it. Whether two
zero bytes end the index, and whether the type of a sensor's slip entry has one byte or two, each frame shows by its own
offsets. Which numbers are forces is found by `slipd.devices.papillarray_layout`.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slipd.devices.walking import Cut, Wrong, within
from slipd.samples import Array

START = b"\x55\x66\x77\x88"
END = b"\xaa\xbb\xcc\xdd"

SENSORS = 2
PILLARS = 9
"""Most of each: three by three on a sensor, two sensors on a controller."""

LONGEST = 1024
"""Bytes of a frame; all blocks of two sensors with the widest offsets fill 915."""

HUB, PILLAR_FORCES, TOTALS, PILLAR_SLIP, SENSOR_SLIP, UNDEFINED = 1, 3, 4, 5, 6, 7
"""Types of a block."""

_WIDTHS = (1, 2, 4)  # of an offset, bytes
_INDEX_END = b"\0\0"
_VECTORS = struct.Struct("<H6f")  # entry type, six numbers
_VECTORS_TYPE = 2
_PILLAR_SLIP = struct.Struct("<Hbf")
_SENSOR_SLIP = {1: struct.Struct("<Bbff"), 2: struct.Struct("<Hbff")}  # by the bytes of the type
_SLIP_TYPE = 1
_HUB = struct.Struct("<IQ")  # packet counter, time in µs
_LATEST_US = 1 << 53  # 285 years
_ENTRIES = np.dtype([("type", "<u2"), ("numbers", "<f4", 6)])
_SUM_LENGTH = 2

_Walk = Callable[[bytes, int, int], int]
"""``walk(body, at, width)`` returns where what begins at ``at`` ends; raises `Cut` or `Wrong`."""


@dataclass(frozen=True, slots=True, eq=False)
class Pad:
    """Content of a frame for one sensor.

    Attributes:
        entries: Six numbers a pillar, shape (pillars, 6): force, N, and displacement, mm, in one order or the other.
        whole_n: The sensor's whole force, N; None where the frame has none.
    """

    entries: Array
    whole_n: list[float] | None


@dataclass(frozen=True, slots=True)
class Body:
    """What is read of a frame.

    Attributes:
        counter: The controller's number of the frame.
        time_us: The controller's clock.
        pads: Of each sensor; None where it has no pillars.
    """

    counter: int
    time_us: int
    pads: list[Pad | None]


def read(buffer: bytes, at: int) -> tuple[int, Body | None]:
    """Return length and content of the valid frame at ``at``.

    Where there is none, the content is None, and the length 0 while more bytes may make it one, -1 where they cannot.
    """
    begin = at + len(START)
    closed = buffer.find(END + START, begin, at + LONGEST + len(START))
    body = buffer[begin : at + LONGEST if closed < 0 else closed + len(END)]
    try:
        blocks, end = _blocks(body)
    except Wrong:
        return -1, None
    except Cut:
        return (0 if closed < 0 and len(buffer) < at + LONGEST else -1), None
    counter, time_us = _HUB.unpack_from(body, blocks[HUB])
    return len(START) + end + _SUM_LENGTH + len(END), Body(counter, time_us, _pads(body, blocks))


def _pads(body: bytes, blocks: dict[int, int]) -> list[Pad | None]:
    """Return the content of the blocks, sensor by sensor."""
    if PILLAR_FORCES not in blocks:
        return []
    wholes = [_VECTORS.unpack_from(body, place)[1:4] for place in _items(body, blocks.get(TOTALS))]
    sensors = _items(body, blocks[PILLAR_FORCES])
    pads: list[Pad | None] = []
    for sensor, begin in enumerate(sensors):
        pillars = _count(body, begin)
        if not pillars:
            pads.append(None)
            continue
        entries = np.frombuffer(body, _ENTRIES, pillars, begin + 2 + pillars * body[0])["numbers"].astype(np.float64)
        pads.append(Pad(entries, list(wholes[sensor]) if len(wholes) == len(sensors) else None))
    return pads


def _items(body: bytes, array: int | None) -> list[int]:
    """Return where each item of a walked array begins; none where there is no array."""
    if array is None:
        return []
    width = body[0]
    return [array + _number(body, array + 2 + item * width, width) for item in range(_count(body, array))]


def _blocks(body: bytes) -> tuple[dict[int, int], int]:
    """Return where each block begins, by type, and where the last one ends."""
    width = body[within(body, 1) - 1]
    if width not in _WIDTHS:
        raise Wrong
    entry = 2 + width
    count, rest = divmod(_number(body, 3, width) - 1, entry)
    if not 1 <= count <= UNDEFINED or rest not in (0, len(_INDEX_END)):
        raise Wrong
    table_end = 1 + count * entry
    if body[table_end : within(body, table_end + rest)] != _INDEX_END[:rest]:
        raise Wrong
    begins = {_count(body, at): _number(body, at + 2, width) for at in range(1, table_end, entry)}
    if HUB not in begins or len(begins) < count:
        raise Wrong
    end = table_end + rest
    for (kind, begin), follower in zip(begins.items(), [*list(begins.values())[1:], None], strict=True):
        end = _block_end(body, kind, begin, follower)
    return begins, end


def _block_end(body: bytes, kind: int, begin: int, follower: int | None) -> int:
    """Return where a block ends: where the one that follows begins, or before the sum and the end marker."""
    if kind == UNDEFINED:
        if follower is None:
            return _found_end(body, begin)
        if follower < begin:
            raise Wrong
        return follower
    failure: type[Exception] = Wrong
    for walk in _WALKS.get(kind, ()):
        try:
            end = walk(body, begin, body[0])
            if end == follower or (follower is None and _is_end(body, end)):
                return end
        except Cut:
            failure = Cut
        except Wrong:
            pass
    raise failure


def _is_end(body: bytes, at: int) -> bool:
    """Return whether the blocks end at ``at``: their sum and the end marker follow."""
    tail = body[at : within(body, at + _SUM_LENGTH + len(END))]
    return tail.endswith(END) and sum(body[:at]) & 0xFFFF == int.from_bytes(tail[:_SUM_LENGTH], "little")


def _found_end(body: bytes, at: int) -> int:
    """Return where the blocks after ``at`` end, which only the sum shows."""
    total, counted = 0, 0
    marker = body.find(END, at + _SUM_LENGTH)
    while marker >= 0:
        end = marker - _SUM_LENGTH
        total, counted = total + sum(body[counted:end]), end
        if total & 0xFFFF == int.from_bytes(body[end:marker], "little"):
            return end
        marker = body.find(END, marker + 1)
    raise Cut


def _number(body: bytes, at: int, width: int) -> int:
    return int.from_bytes(body[at : within(body, at + width)], "little")


def _count(body: bytes, at: int) -> int:
    return _number(body, at, 2)


def _entry(kind: int, size: int, type_bytes: int = 2) -> _Walk:
    """Make the walk of an entry that begins with its type."""

    def walk(body: bytes, at: int, width: int) -> int:
        if _number(body, at, type_bytes) != kind:
            raise Wrong
        return within(body, at + size)

    return walk


def _array(most: int, walk_item: _Walk) -> _Walk:
    """Make the walk of an array: how many items, the offset of each from the array's begin, the items."""

    def walk(body: bytes, at: int, width: int) -> int:
        count = _count(body, at)
        if count > most:
            raise Wrong
        place, end = at + 2, at + 2 + count * width
        for _ in range(count):
            if _number(body, place, width) != end - at:
                raise Wrong
            place += width
            end = walk_item(body, end, width)
        return end

    return walk


def _hub(body: bytes, at: int, width: int) -> int:
    end = within(body, at + _HUB.size)
    if _number(body, at + 4, 8) >= _LATEST_US:
        raise Wrong
    return end


_WALKS: dict[int, tuple[_Walk, ...]] = {
    HUB: (_hub,),
    PILLAR_FORCES: (_array(SENSORS, _array(PILLARS, _entry(_VECTORS_TYPE, _VECTORS.size))),),
    TOTALS: (_array(SENSORS, _entry(_VECTORS_TYPE, _VECTORS.size)),),
    PILLAR_SLIP: (_array(SENSORS, _array(PILLARS, _entry(_SLIP_TYPE, _PILLAR_SLIP.size))),),
    SENSOR_SLIP: tuple(_array(SENSORS, _entry(_SLIP_TYPE, form.size, n)) for n, form in _SENSOR_SLIP.items()),
}
"""The forms that a block of each type may have."""


def encode_blocks(blocks: Sequence[tuple[int, bytes]], width: int = 2, *, index_end: bool = True) -> bytes:
    """Return a frame of blocks, each with its type.

    Args:
        blocks: Type and content of each.
        width: Bytes of an offset.
        index_end: Two zero bytes end the index, as in PTSCOM 2.0.
    """
    behind = _INDEX_END if index_end else b""
    at = 1 + len(blocks) * (2 + width) + len(behind)
    index = bytes((width,))
    for kind, block in blocks:
        index += kind.to_bytes(2, "little") + at.to_bytes(width, "little")
        at += len(block)
    body = index + behind + b"".join(block for _, block in blocks)
    return START + body + (sum(body) & 0xFFFF).to_bytes(_SUM_LENGTH, "little") + END


def encode_hub(counter: int, time_us: int) -> tuple[int, bytes]:
    """Return the block that numbers and times a frame; the counter is sent modulo 2^32."""
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
    """Return the block of the pillars: of each sensor six numbers a pillar, as the layout orders them."""
    sensors = [encode_array([encode_vectors(pillar[:3], pillar[3:]) for pillar in pad], width) for pad in pads]
    return PILLAR_FORCES, encode_array(sensors, width)


def encode_totals(totals: Sequence[NDArray[np.float64] | Sequence[float]], width: int = 2) -> tuple[int, bytes]:
    """Return the block of each sensor's whole force, N, shape (3,); no torque."""
    return TOTALS, encode_array([encode_vectors(total, (0, 0, 0)) for total in totals], width)


def encode_slip(pillars: Sequence[int], width: int = 2, *, type_bytes: int = 1) -> list[tuple[int, bytes]]:
    """Return the two blocks of a slip detection that is switched off.

    Args:
        pillars: How many each sensor has.
        width: Bytes of an offset.
        type_bytes: Of a sensor's entry: 1, as in PTSCOM 2.0, or 2.
    """
    idle = _PILLAR_SLIP.pack(_SLIP_TYPE, 0, 0.0)
    off = _SENSOR_SLIP[type_bytes].pack(_SLIP_TYPE, 0, 0.0, -1.0)
    per_pillar = encode_array([encode_array([idle] * count, width) for count in pillars], width)
    return [(PILLAR_SLIP, per_pillar), (SENSOR_SLIP, encode_array([off] * len(pillars), width))]
