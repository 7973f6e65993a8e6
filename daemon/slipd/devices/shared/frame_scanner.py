"""Search for frames and messages in a byte stream that may start anywhere, lose bytes, and contain noise.

After a candidate that fails, the search advances by one byte. So a header byte inside a float does not keep the search
misaligned, and a good frame after a damaged one is not lost.
"""

from __future__ import annotations

import re
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

from slipd.devices.shared.device_interface import DecoderHealth
from slipd.types.samples import Sample

NO_FRAME = -1
"""What ``measure`` returns where no frame begins."""

PAUSE_NS = 100_000_000
"""A partial frame is dropped after a pause this long, because its reading would be dated at its last byte.

The bytes of a frame follow each other without gaps, except on a late USB adapter, whose gaps are shorter.
"""


class FrameScanner:
    """Find the frames of a device whose frames begin with sync bytes.

    The scanner keeps less than the longest frame between two calls, and finds the same frames however the stream is
    split.

    Args:
        sync: First bytes of every frame.
        measure: ``measure(buffer, at)`` returns the length of the valid frame at ``at``; 0 if the buffer ends too early
            to decide; `NO_FRAME` if there is none. The result must not depend on bytes after the frame, and ``measure``
            must never need more bytes than the longest frame has.
        typical: Length of an ordinary frame, bytes. Damage is counted in frames of this length.
        least: Bytes from ``at`` on without which ``measure`` is not called: where all frames have one length, this one.
        health: Receives ``bad`` and ``bad_bytes``; the decoder updates the other counters.
        text: Bytes that are not counted as damage between frames, such as acknowledgements.
        seek: ``seek(buffer, at)`` returns the first place from ``at`` on where a frame may begin, -1 if there is none.
            It is called after ``measure`` has rejected a place, for frames whose sync is too weak for a search byte by
            byte. By default, the next sync.
    """

    def __init__(
        self,
        sync: bytes,
        measure: Callable[[bytes, int], int],
        typical: int,
        health: DecoderHealth,
        *,
        least: int = 1,
        text: bytes = b"",
        seek: Callable[[bytes, int], int] | None = None,
    ) -> None:
        self._sync = sync
        self._seek = seek or (lambda buffer, at: buffer.find(sync, at))
        self._measure = measure
        self._length, self._least = typical, least
        self._health = health
        self._text = text
        self._tail = b""
        self._damage = 0
        self._received_ns = 0

    def receive(self, data: bytes, t_ns: int | None = None) -> tuple[bytes, list[tuple[int, bool]]]:
        """Scan the next bytes of the stream.

        Args:
            data: The bytes.
            t_ns: Time of receipt, if a pause of `PAUSE_NS` ends a partial frame.

        Returns:
            A buffer, and for each frame in it the offset of the frame and whether the frame is in sync: True if there
            is nothing but text between it and the previous frame.
        """
        if t_ns is not None:
            if self._tail and t_ns - self._received_ns > PAUSE_NS:
                self.forget()
            self._received_ns = t_ns
        buffer = self._tail + data if self._tail else data
        sync, measure, size = self._sync, self._measure, len(buffer)
        last = size - self._least
        found: list[tuple[int, bool]] = []
        done = 0
        at = buffer.find(sync)
        while 0 <= at <= last:
            length = measure(buffer, at)
            if length == 0:
                break
            if length > 0:
                if at > done:
                    self._skip(buffer[done:at])
                found.append((at, self._damage == 0))
                self._damage = 0
                done = at + length
                at = buffer.find(sync, done)
            else:
                at = self._seek(buffer, at + 1)
        if done == size:
            self._tail = b""
            return buffer, found
        keep = at if at >= 0 else self._partial_sync(buffer, done)
        if keep > done:
            self._skip(buffer[done:keep])
        self._tail = buffer[keep:]
        return buffer, found

    @property
    def in_sync(self) -> bool:
        """Whether the stream ends with a whole frame, so that the next bytes begin one."""
        return not self._tail and self._damage == 0

    def forget(self) -> None:
        """Drop a partial frame, because the line was closed or has been silent too long for the rest to come.

        A frame at the beginning of the next bytes is in sync.
        """
        self._skip(self._tail)
        self._tail = b""
        self._damage = 0

    def _partial_sync(self, buffer: bytes, done: int) -> int:
        """Return the offset of an incomplete sync at the end of the buffer, or the end of the buffer."""
        end = len(buffer)
        for size in range(min(len(self._sync) - 1, end - done), 0, -1):
            if buffer.endswith(self._sync[:size]):
                return end - size
        return end

    def _skip(self, skipped: bytes) -> None:
        """Count bytes that belong to no frame."""
        if self._damage == 0:
            skipped = skipped.lstrip(self._text)
        if not skipped:
            return
        before = self._damaged_frames()
        self._damage += len(skipped)
        self._health.bad_bytes += len(skipped)
        self._health.bad += self._damaged_frames() - before

    def _damaged_frames(self) -> int:
        """Return the damage since the last good frame as a number of frames, rounded; any damage is at least one."""
        if self._damage == 0:
            return 0
        return max(1, (self._damage + self._length // 2) // self._length)


MessageT = TypeVar("MessageT")


class MessageScanner(FrameScanner, Generic[MessageT]):
    """Find messages that have no sync bytes and no checksum; each stretch of other bytes counts as one ``bad``.

    Args:
        begin: Pattern of the first bytes of a message.
        read: ``read(buffer, at)`` returns length and content of the message at ``at``; 0 and None if the buffer ends
            too early to decide; `NO_FRAME` and None if no message begins there.
        health: Receives ``bad`` and ``bad_bytes``.
        text: See `FrameScanner`.
    """

    def __init__(
        self,
        begin: re.Pattern[bytes],
        read: Callable[[bytes, int], tuple[int, MessageT | None]],
        health: DecoderHealth,
        *,
        text: bytes = b"",
    ) -> None:
        super().__init__(b"", self._measure_message, sys.maxsize, health, text=text, seek=self._seek_begin)
        self._begin = begin
        self._read = read
        self._found: list[MessageT] = []

    def messages(self, data: bytes) -> list[MessageT]:
        """Scan the next bytes of the stream; return the messages they complete."""
        self._found = []
        self.receive(data)
        return self._found

    def _measure_message(self, buffer: bytes, at: int) -> int:
        """Measure a message for `FrameScanner`, which calls this once per valid message, and keep its content."""
        length, message = self._read(buffer, at)
        if message is not None:
            self._found.append(message)
        return length

    def _seek_begin(self, buffer: bytes, at: int) -> int:
        """Return the index, from ``at`` on, of the first byte that may begin a message; -1 if there is none."""
        begin = self._begin.search(buffer, at)
        return begin.start() if begin else -1


class FrameDecoder(ABC):
    """Base of decoders that find frames by a scanner; a subclass sets ``_frames`` and implements `_readings`.

    Attributes:
        health: Its counts.
        replies: Answers to requests among the bytes received last: what identifies each, and its content.
    """

    _frames: FrameScanner

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self.replies: list[tuple[object, bytes]] = []

    def receive(self, data: bytes, t_ns: int) -> Sequence[Sample]:
        """Decode bytes received at ``t_ns``; return the readings they complete, in the sensor's own frame."""
        self.replies = []
        samples = self._readings(data, t_ns)
        self.health.good += len(samples)
        return samples

    @abstractmethod
    def _readings(self, data: bytes, t_ns: int) -> Sequence[Sample]:
        """Return the readings that the next bytes complete; pass answers to ``replies``."""

    def forget(self) -> None:
        """Drop a partial frame, because the line was closed."""
        self._frames.forget()
