"""Finds frames in a byte stream that may start anywhere, tear, and carry noise.

The search slides by one byte after a candidate that fails, so that a header byte inside a float cannot hold it
on a false grid, and a good frame behind a damaged one is not lost.
"""

from __future__ import annotations

from collections.abc import Callable

from slipd.devices.health import DecoderHealth


class Frames:
    """The scanner shared by all devices whose frames begin with a sync.

    It keeps less than the longest frame between two calls, and finds the same frames however the stream is split.

    Args:
        sync: Bytes every frame begins with.
        measure: ``measure(buffer, at)`` returns the length of the valid frame at ``at``, 0 while the buffer holds too
            little of it to tell, or -1 where there is none. What it answers must not depend on what lies behind the
            frame, and it must not ask for more bytes than the longest frame has.
        typical: Length of an ordinary frame, bytes: damage is counted in frames of it.
        health: Receives ``bad`` and ``bad_bytes``; the other counters are the decoder's.
        text: Bytes that are no damage when they stand between frames, such as acknowledgements.
        seek: ``seek(buffer, at)`` returns where, from ``at`` on, the next frame may begin, -1 for nowhere, after
            ``measure`` refused a place: for frames whose sync is too weak for a search byte by byte. None: at the next
            sync.
    """

    def __init__(
        self,
        sync: bytes,
        measure: Callable[[bytes, int], int],
        typical: int,
        health: DecoderHealth,
        *,
        text: bytes = b"",
        seek: Callable[[bytes, int], int] | None = None,
    ) -> None:
        self._sync = sync
        self._seek = seek or (lambda buffer, at: buffer.find(sync, at))
        self._measure = measure
        self._length = typical
        self._health = health
        self._text = text
        self._tail = b""
        self._damage = 0

    def receive(self, data: bytes) -> tuple[bytes, list[tuple[int, bool]]]:
        """Take the next bytes of the stream.

        Returns:
            A buffer, and per frame in it the offset at which the frame starts and whether the frame is in step:
            true when nothing but text lies between it and the frame before.
        """
        buffer = self._tail + data if self._tail else data
        sync, measure = self._sync, self._measure
        found: list[tuple[int, bool]] = []
        done = 0
        at = buffer.find(sync)
        while at >= 0:
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
        if done == len(buffer):
            self._tail = b""
            return buffer, found
        keep = at if at >= 0 else self._begun_sync(buffer, done)
        if keep > done:
            self._skip(buffer[done:keep])
        self._tail = buffer[keep:]
        return buffer, found

    @property
    def begun(self) -> bool:
        """The stream ends with bytes that may begin a frame."""
        return bool(self._tail)

    @property
    def in_step(self) -> bool:
        """The stream ends with a whole frame: what comes next begins one."""
        return not self._tail and self._damage == 0

    def forget(self) -> None:
        """Drop a begun frame: the line was closed, or has been silent too long for the rest of it to come.

        What comes next follows nothing: a frame at its begin is in step.
        """
        self._skip(self._tail)
        self._tail = b""
        self._damage = 0

    def _begun_sync(self, buffer: bytes, done: int) -> int:
        """Return where a sync starts that the end of the buffer cuts, or the end of the buffer."""
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
        before = self._frames_worth()
        self._damage += len(skipped)
        self._health.bad_bytes += len(skipped)
        self._health.bad += self._frames_worth() - before

    def _frames_worth(self) -> int:
        """How many frames the damage since the last good frame stands for: rounded, but any damage is one."""
        if self._damage == 0:
            return 0
        return max(1, (self._damage + self._length // 2) // self._length)


class FixedFrames(Frames):
    """Frames of one length.

    Args:
        sync: Bytes every frame begins with.
        length: Length of a whole frame, bytes.
        check: ``check(buffer, at)`` says whether the ``length`` bytes from ``at`` are a valid frame.
        health: As of `Frames`.
        text: Likewise.
    """

    def __init__(
        self,
        sync: bytes,
        length: int,
        check: Callable[[bytes, int], bool],
        health: DecoderHealth,
        *,
        text: bytes = b"",
    ) -> None:
        def measure(buffer: bytes, at: int) -> int:
            if at + length > len(buffer):
                return 0
            return length if check(buffer, at) else -1

        super().__init__(sync, measure, length, health, text=text)
