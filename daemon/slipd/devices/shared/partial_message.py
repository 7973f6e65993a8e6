"""Checks of a message that may not have arrived completely.

A parser of such a message raises `Incomplete` if more bytes may complete a message, and `Malformed` if they cannot.
"""

from __future__ import annotations

from collections.abc import Callable


class Incomplete(Exception):  # noqa: N818
    """The buffer ends before the message does."""


class Malformed(Exception):  # noqa: N818
    """There is no valid message."""


def message_length(find_end: Callable[[bytes, int], int], buffer: bytes, at: int, most: int) -> int:
    """Return the length of the message at ``at``; 0 if more bytes are needed to decide, -1 if there is none.

    Args:
        find_end: Returns where the message ends, or raises `Incomplete` or `Malformed`.
        buffer: Bytes received so far.
        at: Where the message begins.
        most: Length of the longest message, bytes.
    """
    try:
        length = find_end(buffer, at) - at
    except Malformed:
        return -1
    except Incomplete:
        return 0 if len(buffer) - at < most else -1
    return length if length <= most else -1


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
