"""The walk along a msgpack map before anything is unpacked, for messages that another process pushes.

msgpack accepts nests of huge lists, extension types and keys that stand twice, and cannot say early that the bytes at
hand will never become a message. So a message is walked first: a map of known keys, each with a value of its own kind.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

FIXMAP, FIXARRAY, FIXSTR, STR8 = 0x80, 0x90, 0xA0, 0xD9


class Cut(Exception):  # noqa: N818
    """The buffer ends before the message does."""


class Wrong(Exception):  # noqa: N818
    """There is no message."""


def length_of(walk: Callable[[bytes, int], int], buffer: bytes, at: int, most: int) -> int:
    """Return the length of the message at ``at``; 0 where more bytes are needed to tell, -1 where there is none.

    Args:
        walk: Returns where the message ends, or raises `Cut` or `Wrong`.
        buffer: What has arrived.
        at: Where the message begins.
        most: Bytes of the longest message.
    """
    try:
        length = walk(buffer, at) - at
    except Wrong:
        return -1
    except Cut:
        return 0 if len(buffer) - at < most else -1
    return length if length <= most else -1


def byte_at(buffer: bytes, at: int) -> int:
    """Return one byte."""
    if at >= len(buffer):
        raise Cut
    return buffer[at]


def within(buffer: bytes, end: int) -> int:
    """Return where something ends, which must have arrived up to there."""
    if end > len(buffer):
        raise Cut
    return end


def known_key(buffer: bytes, at: int, known: Collection[bytes]) -> tuple[bytes, int]:
    """Return the key at ``at`` and where it ends; one that is cut must still be able to become a known one."""
    end = at + 1 + byte_at(buffer, at) - FIXSTR
    if end <= at:
        raise Wrong
    key = buffer[at + 1 : end]
    if end > len(buffer) and any(whole.startswith(key) and len(whole) == end - at - 1 for whole in known):
        raise Cut
    if key not in known or end > len(buffer):
        raise Wrong
    return key, end
