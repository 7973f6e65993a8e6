"""The last entries of a run in memory, compressed; the oldest are dropped."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import msgpack
import zstandard

from slipd.events import Bytes, Event, FirstEvents, LinkDown, LinkUp, Request, StateRestored
from slipd.recording.entry_walk import Entered
from slipd.recording.event_codec import encode_event
from slipd.recording.mcap_file import EVENTS, RecordingFile
from slipd.recording.mcap_records import trimmed

BLOCK_BYTES = 256 * 1024
"""Bytes of entries that are compressed at once, which takes a millisecond without the interpreter lock."""

MOST_BYTES = 256 * 1024 * 1024
"""Most compressed bytes that are kept; a flood of incompressible bytes shortens the time."""

_REST_ENTRIES, _REST_S = 50, 0.001
"""While a file is written, the thread rests after so many entries, so that the live path waits for none of them."""


TARE_LEAD_NS = 500_000_000
"""Readings that are kept from before a tare, which needs fresh ones, and from after its end, ns."""

TARES = 4
"""Requests for a tare that are kept of each sensor: the newest may have been refused."""

_TARE_S, _LONGEST_S = 1.0, 60.0
"""Longest time of a tare whose request states none, and of any, s."""


class _Block(NamedTuple):
    data: bytes
    begin_ns: int
    links: list[StateRestored | LinkUp | LinkDown]
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
        self._open: dict[str, LinkUp] = {}  # the links that were open before the first block
        self._restored: list[StateRestored] = []  # before the first block, likewise
        self._tares = TareEvents()
        self._packer = msgpack.Packer()
        self._compressor = zstandard.ZstdCompressor(level=1)
        self._begin_block()

    def _begin_block(self) -> None:
        self._pieces: list[bytes] = []
        self._piece_bytes = self._begin_ns = 0
        self._links: list[StateRestored | LinkUp | LinkDown] = []

    def add(self, topic: str, content: Event | bytes, t_ns: int) -> None:
        """Keep an event that entered the engine at ``t_ns``, or the bytes that were published because of it."""
        if not isinstance(content, bytes):
            if isinstance(content, (StateRestored, LinkUp, LinkDown)):
                self._links.append(content)
            self._tares.update(Entered(self.next_n, t_ns, content))
            content = encode_event(self.next_n, t_ns, content)
        if not self._pieces:
            self._begin_ns = t_ns
        piece = self._packer.pack((self.next_n, t_ns, topic, content))
        self._pieces.append(piece)
        self._piece_bytes += len(piece)
        self.next_n += 1
        if self._piece_bytes >= BLOCK_BYTES:
            self._end_block()
            self._drop(t_ns)

    def _end_block(self) -> None:
        data = trimmed(self._compressor.compress(b"".join(self._pieces)))
        self._blocks.append(_Block(data, self._begin_ns, self._links, len(self._pieces)))
        self._bytes += len(data)
        self._begin_block()

    def _drop(self, t_ns: int) -> None:
        """Drop the blocks that are older than the time that is kept."""
        blocks = self._blocks
        while len(blocks) > 1 and (blocks[1].begin_ns <= t_ns - self._before_ns or self._bytes > MOST_BYTES):
            in_time = blocks[1].begin_ns <= t_ns - self._before_ns
            dropped = blocks.popleft()
            self.dropped_early += 0 if in_time else dropped.entries
            self._bytes -= len(dropped.data)
            for link in dropped.links:
                if isinstance(link, StateRestored):
                    self._restored = [link]
                    continue
                self._open.pop(link.link, None)
                if isinstance(link, LinkUp):
                    self._open[link.link] = link

    @property
    def first(self) -> int:
        """Index of the first entry of a file."""
        return self._begin_n - len(self._preamble())

    @property
    def _begin_n(self) -> int:
        """Index of the first kept entry."""
        return self.next_n - len(self._pieces) - sum(block.entries for block in self._blocks)

    def _preamble(self) -> list[tuple[int, Event]]:
        """Return the time and event of what precedes the kept entries: the restored state, open links, tares in use."""
        tares = self._tares.before(self._begin_n)
        begin_ns = tares[0].t_ns if tares else self._blocks[0].begin_ns if self._blocks else self._begin_ns
        first: FirstEvents = (*self._restored, *self._open.values())
        return [(begin_ns, event) for event in first] + [(one.t_ns, one.event) for one in tares]

    def write(self, file: RecordingFile) -> None:
        """Write all entries to a file that begins at the index `first`, and finish it.

        Raises:
            OSError: The disk failed.
        """
        for n, (t_ns, event) in enumerate(self._preamble(), start=self.first):
            file.add(n, t_ns, EVENTS, event)
        if self._pieces:
            self._end_block()
        for number, (n, t_ns, topic, payload) in enumerate(self._entries()):
            file.add(n, t_ns, topic, payload)
            if number % _REST_ENTRIES == 0:
                time.sleep(_REST_S)
        file.finish(self.next_n)

    def _entries(self) -> Iterator[tuple[int, int, str, bytes]]:
        for block in self._blocks:
            unpacker = msgpack.Unpacker()
            unpacker.feed(zstandard.decompress(block.data))
            yield from unpacker


class TareEvents:
    """Keeps the readings of the last tares of each sensor, so that a later beginning has the same zero."""

    def __init__(self) -> None:
        self._recent: deque[Entered] = deque()
        self._kept: dict[tuple[object, object], deque[list[Entered]]] = {}
        self._growing: list[tuple[int, list[Entered]]] = []  # until when, and what is kept

    def update(self, entered: Entered) -> None:
        """Update with an event that enters the engine."""
        event, recent = entered.event, self._recent
        if isinstance(event, Request) and event.body.get("op") in ("tare", "tare.undo"):
            self._note_request(event, entered)
            return
        if not isinstance(event, Bytes):
            return
        recent.append(entered)
        while recent[0].t_ns < entered.t_ns - TARE_LEAD_NS:
            recent.popleft()
        for _, kept in self._growing:
            kept.append(entered)
        if self._growing:
            self._growing = [one for one in self._growing if one[0] > entered.t_ns]

    def _note_request(self, request: Request, entered: Entered) -> None:
        body = request.body
        kept = self._kept.setdefault((body.get("finger"), body.get("stream")), deque(maxlen=TARES))
        seconds = body.get("seconds", _TARE_S)
        window = [*self._recent, entered]
        kept.append(window)
        if isinstance(seconds, (int, float)) and 0.0 < seconds < _LONGEST_S:
            self._growing.append((entered.t_ns + round(seconds * 1e9) + TARE_LEAD_NS, window))

    def before(self, n: int) -> list[Entered]:
        """Return the kept events before the index ``n``, in order."""
        windows = (window for kept in self._kept.values() for window in kept)
        return sorted({one.n: one for window in windows for one in window if one.n < n}.values())
