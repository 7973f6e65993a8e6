"""The frames of a Contactile PTS controller: markers, a sum, an index of blocks, and arrays of arrays behind it.

A frame has no length and nothing in it is escaped, so its end is the first end marker at which the sum holds and the
body makes sense; one that a start marker follows directly is its end in any case. Every offset in the body must point
at what lies behind the thing before it, down to the last byte.
Source: the PTS protocol, version 2.0, as a public parser of it reads it; little-endian throughout.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slipd.samples import Array

START = b"\x55\x66\x77\x88"
END = b"\xaa\xbb\xcc\xdd"

SENSORS = 2
PILLARS = 9
"""Most of each: three by three on a sensor, two sensors on a controller."""

LONGEST = 1024
"""Bytes of a frame; all blocks of two sensors with the widest offsets fill 900."""

HUB, PILLAR_FORCES, TOTALS, PILLAR_SLIP, SENSOR_SLIP, UNDEFINED = 1, 3, 4, 5, 6, 7
"""Types of a block."""

_WIDTHS = (1, 2, 4)  # of an offset, bytes
_VECTORS = struct.Struct("<H6f")  # entry type, force in N, displacement in mm or torque in N·mm
_VECTORS_TYPE = 2
_PILLAR_SLIP = struct.Struct("<Hbf")
_SENSOR_SLIP = struct.Struct("<HBff")
_SLIP_TYPE = 1
_HUB = struct.Struct("<IQ")  # packet counter, time in µs
_LATEST_US = 1 << 53  # 285 years
_ENTRIES = np.dtype([("type", "<u2"), ("force", "<f4", 3), ("rest", "<f4", 3)])
_SHORTEST_BODY = 1 + 2 + min(_WIDTHS) + _HUB.size
_SUM_LENGTH = 2

_Walk = Callable[[bytes, int, int], int]
"""``walk(body, at, width)`` returns where the thing at ``at`` ends, -1 where there is no such thing."""


@dataclass(frozen=True, slots=True)
class Body:
    """What is read of a frame.

    Attributes:
        counter: The controller's number of the frame.
        time_us: The controller's clock.
        forces_n: Of each sensor, shape (pillars, 3), N; None where it has no pillars.
    """

    counter: int
    time_us: int
    forces_n: list[Array | None]


def read(buffer: bytes, at: int) -> tuple[int, Body | None]:
    """Return length and content of the valid frame at ``at``.

    Where there is none, the content is None, and the length 0 while more bytes may make it one, -1 where they cannot.
    """
    limit = at + LONGEST
    end = buffer.find(END, at + len(START) + _SHORTEST_BODY + _SUM_LENGTH, limit)
    while end >= 0:
        body = buffer[at + len(START) : end - _SUM_LENGTH]
        if sum(body) & 0xFFFF == int.from_bytes(buffer[end - _SUM_LENGTH : end], "little"):
            blocks = _blocks(body)
            if blocks:
                counter, time_us = _HUB.unpack_from(body, blocks[HUB])
                return end + len(END) - at, Body(counter, time_us, _forces(body, blocks.get(PILLAR_FORCES)))
        if buffer.startswith(START, end + len(END)):
            return -1, None  # the next frame begins: this one is damaged, and need not be waited for
        end = buffer.find(END, end + 1, limit)
    return (-1 if len(buffer) >= limit else 0), None


def _forces(body: bytes, block: int | None) -> list[Array | None]:
    """Return the forces in the pillars' block that begins at ``block``."""
    forces: list[Array | None] = []
    if block is None:
        return forces
    width = body[0]
    for sensor in range(_count(body, block)):
        begin = block + _number(body, block + 2 + sensor * width, width)
        pillars = _count(body, begin)
        place = begin + 2 + pillars * width
        forces.append(np.frombuffer(body, _ENTRIES, pillars, place)["force"].astype(np.float64) if pillars else None)
    return forces


def _blocks(body: bytes) -> dict[int, int]:
    """Return where each block begins, by type; empty where the body is no valid one."""
    width = body[0]
    entry = 2 + width
    if width not in _WIDTHS:
        return {}
    count, rest = divmod(_number(body, 3, width) - 1, entry)
    if rest or not 1 <= count <= UNDEFINED:
        return {}
    table = range(1, 1 + count * entry, entry)
    types = [_count(body, at) for at in table]
    begins = [_number(body, at + 2, width) for at in table]
    blocks = dict(zip(types, begins, strict=True))
    if HUB not in blocks or len(blocks) < count:
        return {}
    for kind, begin, end in zip(types, begins, [*begins[1:], len(body)], strict=True):
        walk = _WALKS.get(kind)
        fits = walk(body, begin, width) == end if walk else kind == UNDEFINED and begin <= end
        if not fits:
            return {}
    return blocks


def _number(body: bytes, at: int, width: int) -> int:
    return int.from_bytes(body[at : at + width], "little")


def _count(body: bytes, at: int) -> int:
    return _number(body, at, 2)


def _entry(kind: int, size: int) -> _Walk:
    """Make the walk of an entry that begins with its type."""

    def walk(body: bytes, at: int, width: int) -> int:
        return at + size if _count(body, at) == kind else -1

    return walk


def _array(most: int, walk_item: _Walk) -> _Walk:
    """Make the walk of an array: how many items, the offset of each from the array's begin, the items."""

    def walk(body: bytes, at: int, width: int) -> int:
        count = _count(body, at)
        if count > most:
            return -1
        place, end = at + 2, at + 2 + count * width
        for _ in range(count):
            if _number(body, place, width) != end - at:
                return -1
            place += width
            end = walk_item(body, end, width)
        return end

    return walk


def _hub(body: bytes, at: int, width: int) -> int:
    return at + _HUB.size if _number(body, at + 4, 8) < _LATEST_US else -1


_WALKS: dict[int, _Walk] = {
    HUB: _hub,
    PILLAR_FORCES: _array(SENSORS, _array(PILLARS, _entry(_VECTORS_TYPE, _VECTORS.size))),
    TOTALS: _array(SENSORS, _entry(_VECTORS_TYPE, _VECTORS.size)),
    PILLAR_SLIP: _array(SENSORS, _array(PILLARS, _entry(_SLIP_TYPE, _PILLAR_SLIP.size))),
    SENSOR_SLIP: _array(SENSORS, _entry(_SLIP_TYPE, _SENSOR_SLIP.size)),
}


def encode_blocks(blocks: Sequence[tuple[int, bytes]], width: int = 2) -> bytes:
    """Return a frame of blocks, each with its type, with offsets of ``width`` bytes."""
    at = 1 + len(blocks) * (2 + width)
    index = bytes((width,))
    for kind, block in blocks:
        index += kind.to_bytes(2, "little") + at.to_bytes(width, "little")
        at += len(block)
    body = index + b"".join(block for _, block in blocks)
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


def encode_vectors(force: Array | Sequence[float], other: Array | Sequence[float]) -> bytes:
    """Return an entry of a force, N, and of a displacement, mm, or a torque, N·mm; each of shape (3,)."""
    return _VECTORS.pack(_VECTORS_TYPE, *force, *other)


def encode_pillars(forces_n: Sequence[Array | Sequence[Sequence[float]]], width: int = 2) -> tuple[int, bytes]:
    """Return the block of the pillars' forces, N, shape (pillars, 3) for each sensor; nothing is displaced."""
    sensors = [encode_array([encode_vectors(force, (0, 0, 0)) for force in pillars], width) for pillars in forces_n]
    return PILLAR_FORCES, encode_array(sensors, width)


def encode_totals(totals: Sequence[NDArray[np.float64] | Sequence[float]], width: int = 2) -> tuple[int, bytes]:
    """Return the block of each sensor's whole force, N, shape (3,); no torque."""
    return TOTALS, encode_array([encode_vectors(total, (0, 0, 0)) for total in totals], width)


def encode_slip(pillars: Sequence[int], width: int = 2) -> list[tuple[int, bytes]]:
    """Return the two blocks of a slip detection that is switched off.

    Args:
        pillars: How many each sensor has.
        width: Bytes of an offset.
    """
    idle = _PILLAR_SLIP.pack(_SLIP_TYPE, 0, 0.0)
    off = _SENSOR_SLIP.pack(_SLIP_TYPE, 0, 0.0, -1.0)
    per_pillar = encode_array([encode_array([idle] * count, width) for count in pillars], width)
    return [(PILLAR_SLIP, per_pillar), (SENSOR_SLIP, encode_array([off] * len(pillars), width))]
