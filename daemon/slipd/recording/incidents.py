"""What happened before a warning or a drop: the last seconds are always kept in memory, and then saved as a file.

The live path only puts entries into a queue; a thread compresses them, and writes the file.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any, NamedTuple

from slipd.config import Incidents as IncidentLimits
from slipd.errors import RecordingError
from slipd.events import Event, FirstEvents, IncidentsChanged
from slipd.recording.entry_ring import EntryRing
from slipd.recording.mcap_file import RecordingFile
from slipd.recording.run_files import RunFiles
from slipd.recording.writer import CLOSE_LIMIT_S, QUEUE_LIMIT

KIND = "incident"

LEVELS = ("caution", "warning", "slipping")
"""Levels that may count as an incident, the least alarming first."""

_PERIOD_S = 0.05
"""How often the thread empties the queue, s: waking for every entry would delay the live path."""

BLOCK_NS = 1_000_000_000
"""Time between two places where a file may begin, ns: each costs the live path what the state of the run takes."""

REPORT_PERIOD_NS = 1_000_000_000
"""Least time between two reports of what was saved and lost."""

_log = logging.getLogger(__name__)

_Entry = tuple[str, Event | bytes, int]
"""Topic, content and time of an entry."""


@dataclass(frozen=True, slots=True)
class _Save:
    """Order to write a file once the entries up to a time are there."""

    path: Path
    until_ns: int


class _Begin(NamedTuple):
    """Order to begin a block of the ring; its arguments."""

    first: FirstEvents
    t_ns: int


class Incidents:
    """Keeps the last seconds of a run, and saves them when a finger warns or the grasp loses its object.

    Call all methods from one thread. None of them blocks but `close`, and none raises because of a disk.

    Args:
        files: The files of the run.
        limits: ``[recording.incidents]``.
        name: Returns the first part of the name of a file, by its time.
        create: Returns a new file, given its path and, as ``first``, the index of its first entry.
        prepare: Called by the thread before it creates a file; a RecordingError from it prevents that.
    """

    def __init__(
        self,
        files: RunFiles,
        limits: IncidentLimits,
        name: Callable[[int], str],
        create: Callable[..., RecordingFile],
        prepare: Callable[[], None],
    ) -> None:
        self._files, self._limits, self._name = files, limits, name
        self._create, self._prepare = create, prepare
        self._levels = LEVELS[LEVELS.index(limits.level) :]
        self._next_ns: dict[str, int] = {}  # before it nothing of a kind is saved
        self._ignored = self._lost = 0
        self._lost_object_ns: int | None = None
        self._outcome = IncidentsChanged(0, 0, 0, 0, "", "")  # the thread replaces it, so no half of it is reported
        self._reported: IncidentsChanged | None = None
        self._report_due_ns = self._block_due_ns = 0
        self._ring = EntryRing(round(limits.before_s * 1e9))
        self._queue: SimpleQueue[_Entry | _Save | _Begin | None] = SimpleQueue()
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
            _log.info("%d incidents within %g s of the last saved one", self._ignored, self._limits.pause_s)
        self._ignored, self._next_ns[kind] = 0, t_ns + round(self._limits.pause_s * 1e9)
        path = self._files.folder / f"{KIND}-{self._name(t_ns)}-{what}.mcap"
        self._queue.put(_Save(path, t_ns + round(self._limits.after_s * 1e9)))

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
            self._queue.put(_Begin(first(), t_ns))
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
        due: list[_Save] = []
        while True:
            try:
                item = self._queue.get_nowait()
            except Empty:
                time.sleep(_PERIOD_S)
                continue
            if item is None:
                break
            if isinstance(item, _Save):
                due.append(item)
                continue
            if isinstance(item, _Begin):
                self._ring.begin_block(*item)
                continue
            while due and item[-1] > due[0].until_ns:
                self._save(due.pop(0))
            self._ring.add(*item)
        for order in due:
            self._save(order)

    def _save(self, order: _Save) -> None:
        """Write the file; a disk that fails costs this file only."""
        try:
            self._prepare()
            self._files.delete_oldest(KIND, self._limits.keep_files - 1)
            file = self._create(self._files.place(order.path), first=self._ring.first)
        except (RecordingError, OSError) as error:
            self._note_failure(order.path, str(error))
            return
        try:
            self._ring.write(file)
        except OSError as error:
            file.remove()
            self._note_failure(file.path, str(error.strerror))
            return
        self._outcome = replace(self._outcome, saved=self._outcome.saved + 1, path=str(file.path), reason="")
        _log.warning("%s: saved, with what happened before", file.path, extra={"slipd_recording": file.path})

    def _note_failure(self, path: Path, reason: str) -> None:
        why = f"{path}: not saved: {reason}"
        self._outcome = replace(self._outcome, failed=self._outcome.failed + 1, reason=why)
        _log.error("%s", why, extra={"slipd_recording": path, "slipd_fault": "incident-failed"})
