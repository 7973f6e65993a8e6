"""Msgpack messages from other processes, checked before they are unpacked.

msgpack accepts nested huge lists, extension types and duplicate keys, and cannot detect early that the bytes received
so far will never become a message. So the bounds of a message are checked first: a map of known keys, each once, each
with a value of its own type. Such a check raises `Incomplete` if more bytes may complete a message, and `Malformed` if
they cannot.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from slipd.devices.shared.frame_scanner import NO_FRAME


class Incomplete(Exception):  # noqa: N818
    """The buffer ends before the message does."""


class Malformed(Exception):  # noqa: N818
    """There is no valid message."""


def message_length(find_end: Callable[[bytes, int], int], most: int, buffer: bytes, at: int) -> int:
    """Return the length of the message at ``at``; 0 if more bytes are needed to decide, else `NO_FRAME`.

    Args:
        find_end: Returns where the message ends, or raises `Incomplete` or `Malformed`.
        most: Length of the longest message, bytes.
        buffer: Bytes received so far.
        at: Where the message begins.
    """
    try:
        length = find_end(buffer, at) - at
    except Malformed:
        return NO_FRAME
    except Incomplete:
        return 0 if len(buffer) - at < most else NO_FRAME
    return length if length <= most else NO_FRAME


def byte_at(buffer: bytes, at: int) -> int:
    """Return one byte.

    Raises:
        Incomplete: It has not arrived yet.
    """
    if at >= len(buffer):
        raise Incomplete
    return buffer[at]


def arrived(buffer: bytes, end: int) -> int:
    """Return ``end`` if the buffer has all bytes before it.

    Raises:
        Incomplete: They have not arrived yet.
    """
    if end > len(buffer):
        raise Incomplete
    return end


FIXMAP, FIXARRAY, FIXSTR, STR8, ARRAY16, NIL = 0x80, 0x90, 0xA0, 0xD9, 0xDC, 0xC0
FLOAT32, FLOAT64 = 0xCA, 0xCB

UINT_LENGTHS = {0xCC: 2, 0xCD: 3, 0xCE: 5, 0xCF: 9}
"""Length of each unsigned integer by its first byte, except those of one byte (0 to 0x7F)."""
NUMBER_LENGTHS = (
    dict.fromkeys((*range(0x80), *range(0xE0, 0x100)), 1)  # integers of one byte
    | UINT_LENGTHS
    | {0xD0: 2, 0xD1: 3, 0xD2: 5, 0xD3: 9}  # signed integers
    | {FLOAT32: 5, FLOAT64: 9}
)
"""Length of each number by its first byte."""

ValueEnd = Callable[[bytes, int], int]
"""``value_end(buffer, at)`` returns where a value ends; raises `Incomplete` or `Malformed`."""


def map_end(buffer: bytes, at: int, sizes: range, value_ends: Mapping[bytes, ValueEnd]) -> tuple[int, set[bytes]]:
    """Return where a map ends, and its keys.

    Args:
        buffer: Bytes received so far.
        at: Where the map begins.
        sizes: Permitted numbers of keys.
        value_ends: For each known key, where its value ends.

    Raises:
        Incomplete: The map has not arrived completely.
        Malformed: It is not such a map.
    """
    size = byte_at(buffer, at) - FIXMAP
    if size not in sizes:
        raise Malformed
    keys: set[bytes] = set()
    at += 1
    for _ in range(size):
        key, at = _known_key(buffer, at, value_ends)
        if key in keys:
            raise Malformed
        keys.add(key)
        at = value_ends[key](buffer, at)
    return at, keys


def text_end(buffer: bytes, at: int, shortest: int, longest: int) -> int:
    """Return where a text of ``shortest`` to ``longest`` bytes ends.

    Raises:
        Incomplete: The text has not arrived completely.
        Malformed: It is not such a text.
    """
    head = byte_at(buffer, at)
    if head == STR8:
        at += 1
        size = byte_at(buffer, at)
    else:
        size = head - FIXSTR if head < FIXSTR + 32 else -1
    if not shortest <= size <= longest:
        raise Malformed
    return arrived(buffer, at + 1 + size)


def unsigned_end(buffer: bytes, at: int) -> int:
    """Return where an integer of at least 0 ends."""
    head = byte_at(buffer, at)
    size = 1 if head < FIXMAP else UINT_LENGTHS.get(head)
    if size is None:
        raise Malformed
    return arrived(buffer, at + size)


def list_head(buffer: bytes, at: int, sizes: range) -> tuple[int, int]:
    """Return the number of items of a list, which must be one of ``sizes``, and where the first begins."""
    head = byte_at(buffer, at)
    if head == ARRAY16:
        begin = arrived(buffer, at + 3)
        count = int.from_bytes(buffer[at + 1 : begin], "big")
    else:
        begin, count = at + 1, head - FIXARRAY
    if count not in sizes or (count > 15 and head != ARRAY16):
        raise Malformed
    return count, begin


def numbers_end(buffer: bytes, at: int, count: int) -> int:
    """Return where ``count`` numbers end."""
    doubles_end = at + 9 * count
    if buffer[at:doubles_end:9] == bytes((FLOAT64,)) * count:  # the usual case: nothing but doubles
        return arrived(buffer, doubles_end)
    for _ in range(count):
        size = NUMBER_LENGTHS.get(byte_at(buffer, at))
        if size is None:
            raise Malformed
        at += size
    return arrived(buffer, at)


def vector_end(length: int) -> ValueEnd:
    """Return the function that finds the end of a list of this many numbers."""

    def find_end(buffer: bytes, at: int) -> int:
        _, begin = list_head(buffer, at, range(length, length + 1))
        return numbers_end(buffer, begin, length)

    return find_end


def _known_key(buffer: bytes, at: int, known: Collection[bytes]) -> tuple[bytes, int]:
    """Return the key at ``at`` and where it ends; a key that is cut may still become a known one."""
    end = at + 1 + byte_at(buffer, at) - FIXSTR
    if end <= at:
        raise Malformed
    key = buffer[at + 1 : end]
    if end > len(buffer) and any(whole.startswith(key) and len(whole) == end - at - 1 for whole in known):
        raise Incomplete
    if key not in known or end > len(buffer):
        raise Malformed
    return key, end
