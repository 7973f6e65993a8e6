"""Record a live run without ever delaying it.

The live path only numbers an entry and puts it into a queue; a thread encodes, compresses and writes. A disk that is
slow, full or gone harms the recording, never the run.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any

from slipd.errors import RecordingError
from slipd.events import Event, RecordingChanged
from slipd.recording.mcap_file import RecordingFile, RunHead
from slipd.recording.run_files import DiskLimits, RecordingLimitError

QUEUE_LIMIT = 65_536
"""Most entries in the queue, about 30 MB: a disk may stall for 5 s at 10,000 entries/s, from two fingers at 4 kHz."""

FLUSH_PERIOD_S = 0.07
"""Most recorded time that a killed process loses, s, besides the queue. A sync follows each flush, so a power cut loses
this and the time of one sync: at most 18 ms on a virtual disk with ext4."""

CLOSE_LIMIT_S = 30.0
"""Longest wait for the disk at the end, s: a lost network mount must not delay the exit any longer."""

LOOK_PERIOD_S = 0.005
"""How often a thread looks into its queue, s: to wake it for every entry costs the live path more than the entry."""

LOOK_ENTRIES = 100
"""Most entries of one look, for which the thread may hold the interpreter lock: some 1 ms, at 20,000 entries/s."""

LOSSES_PERIOD_NS = 1_000_000_000
"""Shortest time between two reports of lost entries."""

START_LIMIT_NS = 500_000_000
"""How long the disk may take to create a file before its recording is given up."""

_log = logging.getLogger(__name__)

_Entry = tuple[int, int, str, Event | bytes]
"""Arguments of `RecordingFile.add`."""


def looks(queue: SimpleQueue[Any]) -> Iterator[list[Any]]:
    """Yield what came into a queue since the last look, until it has None, its last item."""
    found: list[Any] = []
    while None not in found:
        time.sleep(LOOK_PERIOD_S)
        found = [queue.get() for _ in range(min(queue.qsize(), LOOK_ENTRIES))]
        yield [item for item in found if item is not None]


class Recorder:
    """Write the events that enter the engine, and the messages that it publishes, in one total order.

    Call ``add`` from one thread, in the order in which things happen: an event, then the messages that it caused. It
    never blocks, and never raises because of a disk. Each change is logged, and `poll` returns it once.

    Attributes:
        path: The file.
        outcome: State and reason: "starting" until the file is created, then "running"; "limited" if a limit ended the
            recording or prevented its start, "failed" if anything else did.

    Args:
        path: File to write; an existing one is never overwritten.
        head: What the head of the file states of the run.
        t_ns: Now, CLOCK_MONOTONIC.
        prepare: Called on the writer thread, which then also creates the file, so that the caller never waits for a
            disk. A RecordingError from it becomes the failure or limit. None: the file is created at once.
        place: Called after ``prepare`` with the path; returns the one to create. None: the path itself.
        limits: Limits on the disk space; None: no limit.

    Raises:
        RecordingError: The file cannot be created (only without ``prepare``).
    """

    def __init__(
        self,
        path: Path,
        head: RunHead,
        t_ns: int = 0,
        *,
        prepare: Callable[[], None] | None = None,
        place: Callable[[Path], Path] | None = None,
        limits: DiskLimits | None = None,
    ) -> None:
        self.path = path
        self._name = path.name
        self._prepare, self._place = prepare, place
        self._limits = limits
        self._head = head
        self._file = RecordingFile(path, head) if prepare is None else None
        self.outcome = ("starting", "") if self._file is None else ("running", "")
        self._queue: SimpleQueue[_Entry | None] = SimpleQueue()
        self._entries = 0
        self._next_entry = 0  # the one after the last entry taken from the queue
        self._refused = 0  # entries lost to a full queue; counted by the thread of the caller
        self._unwritten = 0  # taken from the queue but not yet known to be in the file; counted by the writer thread
        self._closed = self._discarded = False
        self._started_ns = self._losses_due_ns = t_ns
        self._reported: RecordingChanged | None = None
        self._thread = Thread(target=self._run, name=f"recorder {path.name}", daemon=True)
        self._thread.start()

    @property
    def finished(self) -> bool:
        """Whether the file is complete or given up; `close` then does not wait."""
        return not self._thread.is_alive()

    @property
    def size_bytes(self) -> int:
        """Size of the file, bytes, up to the last flush; 0 before it is created."""
        return 0 if self._file is None else self._file.tell()

    @property
    def lost(self) -> int:
        """Number of entries known to be missing from the file, because the queue overflowed or the disk failed."""
        return self._refused + (self._unwritten if self.outcome[0] == "failed" else 0)

    @property
    def over(self) -> bool:
        """Whether the end of a recording that ended by itself has been reported."""
        return self._reported is not None and self._reported.state != "running"

    def poll(self, t_ns: int) -> RecordingChanged | None:
        """Return what changed since the last report; None if nothing did.

        A file that the disk does not create in time is given up; the thread removes it as soon as it can.
        """
        change, before = self._change(t_ns), self._reported
        if change is None or change == before or self.over:  # `close` reports what is lost after the end
            return None
        if before is not None and change.state == before.state and t_ns < self._losses_due_ns:
            return None
        self._reported = change
        self._losses_due_ns = t_ns + LOSSES_PERIOD_NS
        _log_change(change)
        return change

    def _change(self, t_ns: int) -> RecordingChanged | None:
        path, (state, reason) = str(self.path), self.outcome
        if state != "starting":
            return RecordingChanged(self._name, path, state, reason, self.lost)
        if t_ns - self._started_ns < START_LIMIT_NS:
            return None
        self.discard()
        reason = f"{path}: the disk did not create the file within {START_LIMIT_NS * 1e-9:g} s"
        return RecordingChanged(self._name, path, "failed", reason)

    def add(self, topic: str, content: Event | bytes, t_ns: int) -> None:
        """Record an event that enters the engine at ``t_ns``, or the bytes that were published because of it.

        Args:
            topic: Topic of the message, or `EVENTS`.
            content: The bytes, or the event, which must not change afterwards.
            t_ns: Time of the event, CLOCK_MONOTONIC.
        """
        if self._closed:
            raise ValueError(f"{self.path} is closed; create a new recorder")
        entry = (self._entries, t_ns, topic, content)
        self._entries += 1
        if self._queue.qsize() >= QUEUE_LIMIT:
            self._refused += 1
        else:
            self._queue.put(entry)

    def end(self) -> None:
        """Stop recording, and let the thread finish the file."""
        if not self._closed:
            self._closed = True
            self._queue.put(None)

    def discard(self) -> None:
        """Stop recording, and let the thread remove the file."""
        self._discarded = True
        self.end()

    def close(self, within_s: float = CLOSE_LIMIT_S) -> None:
        """Write the queued entries and finish the file, and log what was lost.

        Args:
            within_s: Longest wait for the disk, s.

        Raises:
            RecordingError: The disk failed, now or before; everything flushed before is readable.
        """
        self.end()
        self._thread.join(within_s)
        if self._thread.is_alive():
            raise RecordingError(f"{self.path}: the disk did not write the last entries in time")
        state, reason = self.outcome
        if state == "failed":
            raise RecordingError(f"{reason}; {self.lost} entries are missing" if self.lost else reason)
        if self.lost:
            line = "%s: %d entries are missing: the disk was too slow"
            _log.warning(line, self.path, self.lost, extra={"slipd_recording": self.path})

    def _run(self) -> None:
        file = self._file
        try:
            if self._prepare is not None:
                self._prepare()
            if self._place is not None:
                self.path = self._place(self.path)
            self._file = file = file or RecordingFile(self.path, self._head)
            self.outcome = ("running", "")
            self._write_until_closed(file)
            file.finish(self._entries)
        except RecordingLimitError as error:
            self._end_at_limit(file, error)
        except Exception as error:  # of any kind: a thread must not end silently
            self._fail(file, error)
        if self._discarded and file is not None:
            file.remove()

    def _end_at_limit(self, file: RecordingFile | None, error: RecordingLimitError) -> None:
        """Finish the file after the entries written so far; the disk may fail here too."""
        if file is not None:
            try:
                file.finish(self._next_entry)
            except Exception as worse:
                self._fail(file, worse)
                return
        self.outcome = ("limited", f"{self.path}: {error}")
        self._discard_until_closed()

    def _fail(self, file: RecordingFile | None, error: Exception) -> None:
        """Give up the file: end it after the flushed entries, and again with the final count when the run ends."""
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        if file is None:
            self.outcome = ("failed", str(error))
            self._discard_until_closed()
            return
        self.outcome = ("failed", f"{self.path}: the recording stopped: {reason}")
        file.stop(self._entries, reason)
        self._discard_until_closed()
        file.stop(self._entries, reason)
        file.close()

    def _write_until_closed(self, file: RecordingFile) -> None:
        next_flush_s = time.monotonic() + FLUSH_PERIOD_S
        for entries in looks(self._queue):
            self._unwritten += len(entries)
            for entry in entries:
                file.add(*entry)
                self._next_entry = entry[0] + 1
            now_s = time.monotonic()
            if now_s >= next_flush_s:
                file.end_chunk()
                file.sync()
                self._unwritten = 0
                if self._limits is not None:
                    self._limits.check(file)
                next_flush_s = now_s + FLUSH_PERIOD_S

    def _discard_until_closed(self) -> None:
        if self._closed and self._queue.empty():
            return
        for entries in looks(self._queue):
            self._unwritten += len(entries)


def _log_change(change: RecordingChanged) -> None:
    fields = {"slipd_recording": change.path}
    if change.state == "failed":
        _log.error("%s", change.reason, extra=fields | {"slipd_fault": "recording-failed"})
    elif change.state == "limited":
        _log.warning("%s", change.reason, extra=fields | {"slipd_fault": "recording-limited"})
    elif change.lost:
        _log.warning("%s: %d entries lost so far: the disk is too slow", change.path, change.lost, extra=fields)
    else:
        _log.info("%s: recording", change.path, extra=fields)
