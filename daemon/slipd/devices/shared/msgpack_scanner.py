"""Search for msgpack messages in a byte stream that may contain garbage."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Generic, TypeVar

from slipd.devices.shared.decoder_health import DecoderHealth

MessageT = TypeVar("MessageT")

FREE_TRIES, BYTES_PER_TRY = 64, 64
"""In a stretch of garbage, the places that are checked at once, and then the bytes per further place.

Each check takes microseconds, and any two bytes may look like the beginning of a message.
"""


class MsgpackScanner(Generic[MessageT]):
    """Find messages; count each stretch of other bytes as one ``bad``, and its length as ``bad_bytes``.

    Args:
        begin: Pattern of the first bytes of a message.
        measure: ``measure(buffer, at)`` returns the length of the message at ``at``; 0 if the buffer ends too early to
            decide; -1 if there is none.
        parse: ``parse(data)`` returns a measured message; None if a value in it is impossible.
        health: Receives ``bad`` and ``bad_bytes``.
        limited: Whether to limit the number of places that are checked in garbage.
    """

    def __init__(
        self,
        begin: re.Pattern[bytes],
        measure: Callable[[bytes, int], int],
        parse: Callable[[bytes], MessageT | None],
        health: DecoderHealth,
        *,
        limited: bool,
    ) -> None:
        self._begin = begin
        self._measure = measure
        self._parse = parse
        self._health = health
        self._bytes_per_try = BYTES_PER_TRY if limited else 0
        self._tail = b""
        self._garbage = 0  # bytes of the stretch of garbage before the tail
        self._tries = 0  # places in it that were checked in vain

    def messages(self, data: bytes) -> list[MessageT]:
        """Scan the next bytes of the stream; return the messages they complete."""
        buffer = self._tail + data
        found: list[MessageT] = []
        done, at = 0, self._next_try(0)
        while (begin := self._begin.search(buffer, at)) is not None:
            at = begin.start()
            length = self._measure(buffer, at)
            if length == 0:
                break
            message = self._parse(buffer[at : at + length]) if length > 0 else None
            if message is None:
                self._tries += 1
                at = max(at + 1, self._next_try(done))
                continue
            self._drop(at - done)
            self._garbage = self._tries = 0
            done = at = at + length
            found.append(message)
        keep = at if begin is not None else len(buffer)
        self._drop(keep - done)
        self._tail = buffer[keep:]
        return found

    def forget(self) -> None:
        """Drop a partial message, because the line was closed."""
        self._drop(len(self._tail))
        self._tail = b""

    def _drop(self, count: int) -> None:
        """Count bytes that belong to no message."""
        if count:
            self._health.bad_bytes += count
            self._health.bad += not self._garbage
            self._garbage += count

    def _next_try(self, done: int) -> int:
        """Return the first place that may be checked in the garbage that continues at ``done``."""
        return max(0, done + (self._tries - FREE_TRIES) * self._bytes_per_try - self._garbage)
