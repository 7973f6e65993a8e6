"""The shape of a message that another process pushes, told byte by byte before anything is unpacked.

The one shape that is accepted is walked first (`slipd.devices.walking`). What is unpacked afterwards can only be that.
"""

from __future__ import annotations

from slipd.devices.walking import FIXARRAY, FIXMAP, FIXSTR, STR8, Wrong, byte_at, known_key, length_of, within

MAX_MESSAGE = 1 << 16
"""Bytes. A pad of 64 by 64 taxels fills 37,000."""

MAX_TAXELS = 4096
"""The largest pad that a config can describe, 64 by 64."""

MAX_NAME = 64
MAX_STATUS = 8
MAX_WORD = 32

AXES = 3

FEWEST_FIELDS, MOST_FIELDS = 3, 6
"""``stream``, ``t_ns`` and the values; beside them a torque, ``seq`` and ``status``."""

_ARRAY16, _FLOAT64, _NIL = 0xDC, 0xCB, 0xC0
_UINT = {0xCC: 2, 0xCD: 3, 0xCE: 5, 0xCF: 9}
_NUMBER = [0] * 256  # length of the number that begins with a byte; 0 where none does
for _byte in (*range(0x80), *range(0xE0, 0x100)):
    _NUMBER[_byte] = 1
for _byte, _length in (*_UINT.items(), (0xCA, 5), (_FLOAT64, 9), (0xD0, 2), (0xD1, 3), (0xD2, 5), (0xD3, 9)):
    _NUMBER[_byte] = _length


def measure(buffer: bytes, at: int) -> int:
    """Return the length of the message at ``at``; 0 where more bytes are needed to tell, -1 where there is none."""
    return length_of(_map_end, buffer, at, MAX_MESSAGE)


def _map_end(buffer: bytes, at: int) -> int:
    fields = byte_at(buffer, at) - FIXMAP
    if not FEWEST_FIELDS <= fields <= MOST_FIELDS:
        raise Wrong
    seen: set[bytes] = set()
    at += 1
    for _ in range(fields):
        key, at = known_key(buffer, at, _ENDS)
        if key in seen:
            raise Wrong
        seen.add(key)
        at = _ENDS[key](buffer, at)
    if not {b"stream", b"t_ns"} <= seen or (b"force_n" in seen) == (b"values" in seen):
        raise Wrong
    if b"torque_nm" in seen and b"values" in seen:
        raise Wrong
    return at


def _text_end(buffer: bytes, at: int, most: int) -> int:
    head = byte_at(buffer, at)
    if head == STR8:
        at += 1
        size = byte_at(buffer, at)
    else:
        size = head - FIXSTR if head < FIXSTR + 32 else 0
    if not 0 < size <= most:
        raise Wrong
    return within(buffer, at + 1 + size)


def _stream_end(buffer: bytes, at: int) -> int:
    return _text_end(buffer, at, MAX_NAME)


def _whole_end(buffer: bytes, at: int) -> int:
    """Where an integer of 0 or more ends."""
    head = byte_at(buffer, at)
    size = 1 if head < FIXMAP else _UINT.get(head)
    if size is None:
        raise Wrong
    return within(buffer, at + size)


def _items(buffer: bytes, at: int, most: int) -> tuple[int, int]:
    """Return how many items a list has and where the first begins."""
    head = byte_at(buffer, at)
    if head == _ARRAY16:
        begin = within(buffer, at + 3)
        count = int.from_bytes(buffer[at + 1 : begin], "big")
    else:
        begin, count = at + 1, head - FIXARRAY
    if not 0 <= count <= (most if head == _ARRAY16 else min(most, 15)):
        raise Wrong
    return count, begin


def _numbers_end(buffer: bytes, at: int, count: int) -> int:
    quick = at + 9 * count
    if buffer[at:quick:9] == bytes((_FLOAT64,)) * count:  # the usual case: nothing but doubles
        return within(buffer, quick)
    for _ in range(count):
        size = _NUMBER[byte_at(buffer, at)]
        if not size:
            raise Wrong
        at += size
    return within(buffer, at)


def _vector_end(buffer: bytes, at: int) -> int:
    count, begin = _items(buffer, at, AXES)
    if count != AXES:
        raise Wrong
    return _numbers_end(buffer, begin, AXES)


def _torque_end(buffer: bytes, at: int) -> int:
    return at + 1 if byte_at(buffer, at) == _NIL else _vector_end(buffer, at)


def _values_end(buffer: bytes, at: int) -> int:
    count, begin = _items(buffer, at, MAX_TAXELS)
    if not count:
        raise Wrong
    if _NUMBER[byte_at(buffer, begin)]:
        return _numbers_end(buffer, begin, count)
    for _ in range(count):
        begin = _vector_end(buffer, begin)
    return begin


def _status_end(buffer: bytes, at: int) -> int:
    count, at = _items(buffer, at, MAX_STATUS)
    for _ in range(count):
        at = _text_end(buffer, at, MAX_WORD)
    return at


_ENDS = {
    b"stream": _stream_end,
    b"t_ns": _whole_end,
    b"seq": _whole_end,
    b"force_n": _vector_end,
    b"torque_nm": _torque_end,
    b"values": _values_end,
    b"status": _status_end,
}
"""Where the value of each key ends."""
