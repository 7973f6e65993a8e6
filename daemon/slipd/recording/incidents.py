"""What happened before a warning or a drop: the last seconds are always kept in memory, and then saved as a file.

The live path only puts entries into a queue; a thread compresses them, and writes the file.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any

import msgpack
import zstandard

from slipd.config import Incidents as IncidentLimits
from slipd.errors import RecordingError
from slipd.events import Event, FirstEvents, IncidentsChanged
from slipd.recording.event_codec import encode_event
from slipd.recording.mcap_file import EVENTS, RecordingFile
from slipd.recording.recorder import CLOSE_LIMIT_S, QUEUE_LIMIT, looks
from slipd.recording.run_files import RunFiles

INCIDENT_KIND = "incident"
"""Kind of the files of incidents."""

INCIDENT_LEVELS = ("caution", "warning", "slipping")
"""Levels that may count as an incident, the least alarming first."""

BLOCK_NS = 1_000_000_000
"""Time between two places where a file may begin, ns: each costs the live path what the state of the run takes."""

REPORT_PERIOD_NS = 1_000_000_000
"""Least time between two reports of what was saved and lost."""

MOST_BYTES = 256 * 1024 * 1024
"""Most compressed bytes that are kept; a flood of incompressible bytes shortens the time."""

_REST_ENTRIES, _REST_S = 50, 0.001
"""While a file is written, the thread rests after so many entries, so that the live path waits for none of them."""

_log = logging.getLogger(__name__)


@dataclass(slots=True)
class _Block:
    """Entries that are dropped together.

    Attributes:
        first: What precedes a file that begins with it.
        begin_ns: When it begins, CLOCK_MONOTONIC.
        pieces: Its entries; of all blocks but the newest they are one piece, compressed.
        entries: Their number.
    """

    first: FirstEvents
    begin_ns: int
    pieces: list[bytes] = field(default_factory=list)
    entries: int = 0


class EntryRing:
    """Keeps entries of the last seconds, compressed. Not safe for threads: one thread adds and writes.

    Args:
        before_ns: Time that is kept, ns.

    Attributes:
        next_n: Index of the next entry.
        dropped_early: Number of entries dropped before their time, because the memory was full.
    """

    def __init__(self, before_ns: int) -> None:
        self.next_n = self.dropped_early = 0
        self._before_ns = before_ns
        self._blocks = deque([_Block((), 0)])
        self._bytes = 0
        self._compressor = zstandard.ZstdCompressor(level=1)

    def begin_block(self, first: FirstEvents, t_ns: int) -> None:
        """Begin a block, with which a file may begin, and drop those that are older than the time that is kept.

        Args:
            first: The events that precede a file that begins now.
            t_ns: Now, CLOCK_MONOTONIC.
        """
        if self.next_n < len(first):  # the run has just begun: no entry would leave them an index
            return
        blocks = self._blocks
        # a copy of its own size: compressed bytes keep the memory of the largest possible result
        packed = bytes(memoryview(self._compressor.compress(b"".join(blocks[-1].pieces))))
        blocks[-1].pieces = [packed]
        self._bytes += len(packed)
        blocks.append(_Block(first, t_ns))
        while len(blocks) > 2 and (blocks[1].begin_ns <= t_ns - self._before_ns or self._bytes > MOST_BYTES):
            in_time = blocks[1].begin_ns <= t_ns - self._before_ns
            dropped = blocks.popleft()
            self.dropped_early += 0 if in_time else dropped.entries
            self._bytes -= len(dropped.pieces[0])

    def add(self, topic: str, content: Event | bytes, t_ns: int) -> None:
        """Keep an event that entered the engine at ``t_ns``, or the bytes that were published because of it."""
        payload = content if isinstance(content, bytes) else encode_event(self.next_n, t_ns, content)
        block = self._blocks[-1]
        block.pieces.append(msgpack.packb((self.next_n, t_ns, topic, payload)))
        block.entries += 1
        self.next_n += 1

    @property
    def first(self) -> int:
        """Index of the first entry of a file."""
        return self.next_n - sum(block.entries for block in self._blocks) - len(self._blocks[0].first)

    def write(self, file: RecordingFile) -> None:
        """Write all entries to a file that begins at the index `first`, and finish it.

        Raises:
            OSError: The disk failed.
        """
        oldest = self._blocks[0]
        for n, event in enumerate(oldest.first, start=self.first):
            file.add(n, oldest.begin_ns, EVENTS, event)
        for number, entry in enumerate(self._entries()):
            file.add(*entry)
            if number % _REST_ENTRIES == 0:
                time.sleep(_REST_S)
        file.finish(self.next_n)

    def _entries(self) -> Iterator[tuple[int, int, str, bytes]]:
        unpacker = msgpack.Unpacker()
        for block in list(self._blocks)[:-1]:
            unpacker.feed(zstandard.decompress(block.pieces[0]))
            yield from unpacker
        unpacker.feed(b"".join(self._blocks[-1].pieces))
        yield from unpacker


_Entry = tuple[str, Event | bytes, int]
"""Topic, content and time of an entry."""


class Incidents:
    """Keeps the last seconds of a run, and saves them when a finger warns or the grasp loses its object.

    Call all methods from one thread. None of them blocks but `close`, and none raises because of a disk.

    Args:
        files: The files of the run.
        limits: ``[recording.incidents]``.
        name: Returns the first part of the name of a file, by its time.
        create: Returns a new file, given its path and the index of its first entry.
        prepare: Called by the thread before it creates a file; a RecordingError from it prevents that.
    """

    def __init__(
        self,
        files: RunFiles,
        limits: IncidentLimits,
        name: Callable[[int], str],
        create: Callable[[Path, int], RecordingFile],
        prepare: Callable[[], None],
    ) -> None:
        self._files, self._limits, self._name = files, limits, name
        self._create, self._prepare = create, prepare
        self._levels = INCIDENT_LEVELS[INCIDENT_LEVELS.index(limits.level) :]
        self._next_ns: dict[str, int] = {}  # before it nothing of a kind is saved
        self._ignored = self._lost = 0
        self._lost_object_ns: int | None = None
        self._outcome = IncidentsChanged(0, 0, 0, 0, "", "")  # the thread replaces it, so no half of it is reported
        self._reported: IncidentsChanged | None = None
        self._report_due_ns = self._block_due_ns = 0
        self._ring = EntryRing(round(limits.before_s * 1e9))
        self._due: list[tuple[Path, int]] = []  # files to be written once the entries up to a time are there
        self._queue: SimpleQueue[_Entry | Callable[[], None] | None] = SimpleQueue()
        self._thread = Thread(target=self._run, name="incidents", daemon=True)
        self._thread.start()

    def add(self, topic: str, content: Event | bytes, t_ns: int) -> None:
        """Keep an event that enters the engine at ``t_ns``, or the bytes that were published because of it."""
        if self._queue.qsize() < QUEUE_LIMIT:
            self._queue.put((topic, content, t_ns))
        else:  # the disk is slow; the file will have a gap of time
            self._lost += 1

    def note_warning(self, body: Mapping[str, Any], t_ns: int) -> None:
        """Save what happened if a message of the topic ``warning``, published at ``t_ns``, is reason enough.

        Within `pause_s` of the last saving nothing is saved: a chattering warning must not fill the disk.
        """
        level, lost = body["level"], body["level"] == "no_contact" and body["previous"] in self._levels
        if level in self._levels or lost:
            self._order("warnings", f"{body['finger']}-{'contact_lost' if lost else level}", t_ns)

    def note_grasp(self, body: Mapping[str, Any], t_ns: int) -> None:
        """Save what happened if a message of the topic ``grasp``, published at ``t_ns``, reports a loss.

        Losses have a pause of their own: the drop that a warning announced is saved too.
        """
        if body["state"] == "lost" and body["state_t_ns"] != self._lost_object_ns:
            self._lost_object_ns = body["state_t_ns"]
            self._order("losses", "grasp-lost", t_ns)

    def _order(self, kind: str, what: str, t_ns: int) -> None:
        if t_ns < self._next_ns.get(kind, t_ns):
            self._ignored += 1
            return
        if self._ignored:
            _log.info("incidents within %g s of the last saved one, not saved: %d", self._limits.pause_s, self._ignored)
        self._ignored, self._next_ns[kind] = 0, t_ns + round(self._limits.pause_s * 1e9)
        path = self._files.folder / f"{INCIDENT_KIND}-{self._name(t_ns)}-{what}.mcap"
        self._queue.put(partial(self._due.append, (path, t_ns + round(self._limits.after_s * 1e9))))

    def follow(self, t_ns: int, first: Callable[[], FirstEvents]) -> IncidentsChanged | None:
        """Note what precedes a file that begins now if it is time; return what was saved and lost so far.

        Args:
            t_ns: Now, CLOCK_MONOTONIC.
            first: Returns the events that precede a file that begins now.

        Returns:
            None if it is known, or was reported within the last second.
        """
        if t_ns >= self._block_due_ns:
            self._block_due_ns = t_ns + BLOCK_NS
            self._queue.put(partial(self._ring.begin_block, first(), t_ns))
        now = replace(self._outcome, lost=self._lost, dropped=self._ring.dropped_early)
        if now == self._reported or t_ns < self._report_due_ns:
            return None
        self._reported, self._report_due_ns = now, t_ns + REPORT_PERIOD_NS
        return now

    def close(self) -> None:
        """End the thread; what waits to be saved is saved as it is."""
        self._queue.put(None)
        self._thread.join(CLOSE_LIMIT_S)

    def _run(self) -> None:
        for items in looks(self._queue):
            for item in items:
                if callable(item):
                    item()
                    continue
                while self._due and item[-1] > self._due[0][1]:
                    self._save(self._due.pop(0)[0])
                self._ring.add(*item)
        for path, _ in self._due:
            self._save(path)

    def _save(self, path: Path) -> None:
        """Write the file; a disk that fails costs this file only."""
        file: RecordingFile | None = None
        try:
            self._prepare()
            self._files.delete_oldest(INCIDENT_KIND, self._limits.keep_files - 1)
            path = self._files.place(path)
            file = self._create(path, self._ring.first)
            self._ring.write(file)
        except (RecordingError, OSError) as error:
            if file is not None:
                file.remove()
            why = f"{path}: not saved: {getattr(error, 'strerror', None) or error}"
            self._outcome = replace(self._outcome, failed=self._outcome.failed + 1, reason=why)
            _log.error("%s", why, extra={"slipd_recording": path, "slipd_fault": "incident-failed"})
            return
        self._outcome = replace(self._outcome, saved=self._outcome.saved + 1, path=str(path), reason="")
        _log.warning("%s: saved, with what happened before", path, extra={"slipd_recording": path})
