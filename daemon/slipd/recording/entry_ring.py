"""The last entries of a run in memory, compressed; the oldest are dropped."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import msgpack
import zstandard

from slipd.events import Event, FirstEvents
from slipd.recording.event_codec import encode_event
from slipd.recording.mcap_file import EVENTS, RecordingFile
from slipd.recording.mcap_records import trimmed

MOST_BYTES = 256 * 1024 * 1024
"""Most compressed bytes that are kept; a flood of incompressible bytes shortens the time."""

_REST_ENTRIES, _REST_S = 50, 0.001
"""While a file is written, the thread rests after so many entries, so that the live path waits for none of them."""


class _Block(NamedTuple):
    """Entries that are dropped together.

    Attributes:
        first: What precedes a file that begins with it.
        begin_ns: When it begins, CLOCK_MONOTONIC.
        data: Its entries, compressed.
        entries: Their number.
    """

    first: FirstEvents
    begin_ns: int
    data: bytes
    entries: int


class EntryRing:
    """Keeps entries of the last seconds. Not safe for threads: one thread adds and writes.

    Args:
        before_ns: Time that is kept, ns.

    Attributes:
        next_n: Index of the next entry.
        dropped_early: Number of entries dropped before their time, because the memory was full.
    """

    def __init__(self, before_ns: int) -> None:
        self.next_n = self.dropped_early = 0
        self._before_ns = before_ns
        self._blocks: deque[_Block] = deque()
        self._bytes = 0
        self._first: FirstEvents = ()
        self._begin_ns = 0
        self._pieces: list[bytes] = []
        self._packer = msgpack.Packer()
        self._compressor = zstandard.ZstdCompressor(level=1)

    def begin_block(self, first: FirstEvents, t_ns: int) -> None:
        """Begin a block, with which a file may begin, and drop those that are older than the time that is kept.

        Args:
            first: The events that precede a file that begins now.
            t_ns: Now, CLOCK_MONOTONIC.
        """
        if self.next_n < len(first):  # the run has just begun: no entry would leave them an index
            return
        data = trimmed(self._compressor.compress(b"".join(self._pieces)))
        self._blocks.append(_Block(self._first, self._begin_ns, data, len(self._pieces)))
        self._bytes += len(data)
        self._first, self._begin_ns, self._pieces = first, t_ns, []
        blocks = self._blocks
        while len(blocks) > 1 and (blocks[1].begin_ns <= t_ns - self._before_ns or self._bytes > MOST_BYTES):
            in_time = blocks[1].begin_ns <= t_ns - self._before_ns
            dropped = blocks.popleft()
            self.dropped_early += 0 if in_time else dropped.entries
            self._bytes -= len(dropped.data)

    def add(self, topic: str, content: Event | bytes, t_ns: int) -> None:
        """Keep an event that entered the engine at ``t_ns``, or the bytes that were published because of it."""
        payload = content if isinstance(content, bytes) else encode_event(self.next_n, t_ns, content)
        self._pieces.append(self._packer.pack((self.next_n, t_ns, topic, payload)))
        self.next_n += 1

    @property
    def first(self) -> int:
        """Index of the first entry of a file."""
        kept = len(self._pieces) + sum(block.entries for block in self._blocks)
        return self.next_n - kept - len(self._preamble()[0])

    def _preamble(self) -> tuple[FirstEvents, int]:
        """Return what precedes the kept entries, and when they begin."""
        return (self._blocks[0].first, self._blocks[0].begin_ns) if self._blocks else (self._first, self._begin_ns)

    def write(self, file: RecordingFile) -> None:
        """Write all entries to a file that begins at the index `first`, and finish it.

        Raises:
            OSError: The disk failed.
        """
        events, begin_ns = self._preamble()
        for n, event in enumerate(events, start=self.first):
            file.add(n, begin_ns, EVENTS, event)
        for number, entry in enumerate(self._entries()):
            file.add(*entry)
            if number % _REST_ENTRIES == 0:
                time.sleep(_REST_S)
        file.finish(self.next_n)

    def _entries(self) -> Iterator[tuple[int, int, str, bytes]]:
        unpacker = msgpack.Unpacker()
        for block in self._blocks:
            unpacker.feed(zstandard.decompress(block.data))
            yield from unpacker
        unpacker.feed(b"".join(self._pieces))
        yield from unpacker
