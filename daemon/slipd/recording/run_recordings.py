"""All recordings of one run: those on request, that of the whole run, and the last seconds before an incident.

Even the file is created on the thread of the recorder: a client must not be able to make the live path wait for a disk.
"""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from slipd.config import Config, Continuous
from slipd.errors import RecordingError
from slipd.events import Event, FirstEvents, Publish, Record, RecordingChanged, WallClock
from slipd.recording.incidents import Incidents
from slipd.recording.mcap_file import EVENTS, RecordingFile, RunHead, check_new
from slipd.recording.recorder import CLOSE_LIMIT_S, Recorder
from slipd.recording.run_files import DiskLimits, RunFiles, check_folder, private_directory, state_dir
from slipd_client.messages import GRASP_TOPIC, WARNING_TOPIC

RUN_KIND = "run"
"""Kind of the files of the whole run."""

MOST_UNFINISHED = 2
"""Ended recordings that may still be written when another starts; each holds a thread and up to 30 MB."""

RETRY_NS = 60_000_000_000
"""Time from the failure of a file to the next attempt, ns."""

_log = logging.getLogger(__name__)


class RequestedRecordings:
    """Start and end recordings as the engine orders, one at a time.

    No method raises because of a disk, and only `close` waits for one.

    Args:
        directory: Folder of the files.
        make: Returns the recorder of a file that its thread creates, given its path and the time.

    Attributes:
        running: The recording that runs; None where none does.
    """

    def __init__(self, directory: Path, make: Callable[[Path, int], Recorder]) -> None:
        self._directory = directory
        self._make = make
        self._ended: list[Recorder] = []
        self._refused: list[RecordingChanged] = []
        self.running: Recorder | None = None

    def handle(self, record: Record, t_ns: int) -> None:
        """Start a recording, or end the running one; `changes` returns the outcome."""
        if self.running is not None:
            self.running.end()
            self._ended.append(self.running)
            self.running = None
        if record.name:
            path = self._directory / record.name
            try:
                self.running = self._start(path, t_ns)
            except (RecordingError, RuntimeError) as error:  # RuntimeError: the system starts no more threads
                _log.warning("%s: %s", path, error, extra={"slipd_recording": path, "slipd_fault": "recording-failed"})
                self._refused.append(RecordingChanged(record.name, str(path), "failed", f"{path}: {error}"))
                return
            for event in record.first:
                self.running.add(EVENTS, event, t_ns)

    def _start(self, path: Path, t_ns: int) -> Recorder:
        if sum(not recorder.finished for recorder in self._ended) > MOST_UNFINISHED:
            raise RecordingError("the disk is still writing earlier recordings; try again later")
        return self._make(path, t_ns)

    def changes(self, t_ns: int) -> list[RecordingChanged]:
        """Return the changes that the engine must know, each once."""
        done = [each for each in self._ended if each.finished]  # checked first, so that their last change is final
        changes = [*(change for recorder in self._ended if (change := recorder.poll(t_ns))), *self._refused]
        self._refused.clear()
        self._ended = [recorder for recorder in self._ended if recorder not in done]
        if self.running is not None and (change := self.running.poll(t_ns)):
            changes.append(change)
            if change.state != "running":
                self.handle(Record(""), t_ns)
        return changes

    def close(self) -> None:
        """Finish every file; wait at most `CLOSE_LIMIT_S` in total for a disk that hangs."""
        self.handle(Record(""), 0)
        end_s = time.monotonic() + CLOSE_LIMIT_S
        for recorder in self._ended:
            try:
                recorder.close(max(0.0, end_s - time.monotonic()))
            except RecordingError as error:
                if not recorder.over:
                    _log.error("%s", error)


class ContinuousRecording(RequestedRecordings):
    """Records the whole run in files that follow each other, each complete by itself; nothing is lost in between.

    A new file begins when the present one is old or large enough.

    Args:
        directory: Folder of the files.
        make: Returns the recorder of a file that its thread creates, given its path and the time.
        limits: ``[recording.continuous]``.
        name: Returns the name of a file that begins at a time, without kind, number and suffix.
    """

    def __init__(
        self,
        directory: Path,
        make: Callable[[Path, int], Recorder],
        limits: Continuous,
        name: Callable[[int], str],
    ) -> None:
        super().__init__(directory, make)
        self._limits, self._name_at = limits, name
        self._name = ""
        self._count = 0
        self._due_ns: int | None = None

    def follow(self, t_ns: int, first: Callable[[], FirstEvents]) -> list[RecordingChanged]:
        """Begin a new file if it is time; return the changes that the engine must know, each once.

        Args:
            t_ns: Now, CLOCK_MONOTONIC.
            first: Returns the events that precede a file that begins now.
        """
        changes = [change for change in self.changes(t_ns) if change.name == self._name]
        full = self.running is not None and self.running.size_bytes >= self._limits.file_bytes
        if any(change.state != "running" for change in changes):
            self._due_ns = t_ns + RETRY_NS
        elif self._due_ns is None or t_ns >= self._due_ns or full:
            self._count += 1
            self._name = f"{RUN_KIND}-{self._name_at(t_ns)}-{self._count:04}.mcap"
            self._due_ns = t_ns + round(self._limits.file_s * 1e9)
            self.handle(Record(self._name, first()), t_ns)
        return [replace(change, name="") for change in changes]


class RunRecordings:
    """Pass events and messages to every recording, and report what becomes of the files.

    Args:
        config: The rig.
        boot: Id of the run.
        wall: Wall clock of the run.
        record: New file of the whole run; None: the config decides.

    Attributes:
        active: The recordings that run now; where there is none, `event` and `published` need not be called.
        kept: The file of the whole run is worth keeping; it is deleted otherwise.

    Raises:
        RecordingError: The new file exists already, or cannot be created.
    """

    def __init__(self, config: Config, boot: str, wall: WallClock, record: Path | None) -> None:
        self._config, self._boot, self._wall, self._path = config, boot, wall, record
        self._folder = Path(config.recording.directory or state_dir())
        self.active: list[Recorder | Incidents] = []
        self._whole: Recorder | None = None
        self._continuous: ContinuousRecording | None = None
        self._incidents: Incidents | None = None
        self._stack = ExitStack()
        self.kept = False
        if record is not None:
            check_new(record)

    def open(self, t_ns: int) -> None:
        """Create what records from the start of the run; call it once the run can start."""
        limits, enter = self._config.recording, self._stack.enter_context
        disk = DiskLimits(limits.max_bytes, limits.min_free_bytes)
        disk_alone = DiskLimits(sys.maxsize, limits.min_free_bytes)
        check = partial(check_folder, self._folder, disk, limits.max_files)
        make = partial(self._record, limits=disk, prepare=partial(self._prepare, check))
        self._requested = enter(closing(RequestedRecordings(self._folder, make)))
        files = enter(closing(RunFiles(self._folder, self._boot)))
        if self._path is not None:
            self._whole = self._record(self._path, t_ns)
            self._stack.callback(self._close_whole, self._whole)
        elif limits.continuous.enabled:
            rule = limits.continuous
            tidy = partial(files.delete_oldest, RUN_KIND, rule.keep_files - 1, rule.keep_bytes - rule.file_bytes)
            prepare = partial(self._prepare, tidy)
            make = partial(self._record, limits=disk_alone, prepare=prepare, place=files.place)
            self._continuous = enter(closing(ContinuousRecording(self._folder, make, rule, self._name)))
        if limits.incidents.enabled:
            prepare = partial(self._prepare, partial(check_folder, self._folder, disk_alone, sys.maxsize))
            self._incidents = enter(closing(Incidents(files, limits.incidents, self._name, self._create, prepare)))
        self._find_active()

    def _name(self, t_ns: int) -> str:
        """Return the part of a file's name that states when it begins, and the run."""
        return f"{self._wall.stamp(t_ns)}-{self._boot}"

    def _find_active(self) -> None:
        continuous = None if self._continuous is None else self._continuous.running
        found = self._requested.running, self._whole, continuous, self._incidents
        self.active = [each for each in found if each is not None]

    def _prepare(self, then: Callable[[], None]) -> None:
        private_directory(self._folder)
        then()

    def _record(self, path: Path, t_ns: int, **options: Any) -> Recorder:
        return Recorder(path, self._head(), t_ns, **options)

    def _create(self, path: Path, first: int) -> RecordingFile:
        return RecordingFile(path, self._head(), first=first)

    def _head(self) -> RunHead:
        """Return what the head of a file that begins now states of the run."""
        return RunHead(self._config.text, self._boot, self._wall.minus_monotonic_ns)

    def _close_whole(self, whole: Recorder) -> None:
        if not self.kept:
            whole.discard()
        whole.close()

    def close(self) -> None:
        """Finish every file."""
        self._stack.close()

    def event(self, event: Event, t_ns: int) -> None:
        """Record an event that enters the engine at ``t_ns``."""
        for recorder in self.active:
            recorder.add(EVENTS, event, t_ns)

    def published(self, message: Publish, payload: bytes, t_ns: int) -> None:
        """Record the bytes that were published; a warning or a loss saves the last seconds."""
        for recorder in self.active:
            recorder.add(message.topic, payload, t_ns)
        if self._incidents is not None and message.topic == WARNING_TOPIC:
            self._incidents.note_warning(message.body, t_ns)
        elif self._incidents is not None and message.topic == GRASP_TOPIC:
            self._incidents.note_grasp(message.body, t_ns)

    def handle(self, record: Record, t_ns: int) -> None:
        """Start or end a recording on request."""
        self._requested.handle(record, t_ns)
        self._find_active()

    def changes(self, t_ns: int, first: Callable[[], FirstEvents]) -> list[Event]:
        """Return the changes that the engine must know, each once.

        Args:
            t_ns: Now, CLOCK_MONOTONIC.
            first: Returns the events that precede a file that begins now.
        """
        found: list[Event] = []
        if self._whole is not None and (change := self._whole.poll(t_ns)):
            found.append(replace(change, name=""))
        if self._continuous is not None:
            found += self._continuous.follow(t_ns, first)
        if self._incidents is not None and (saved := self._incidents.follow(t_ns, first)):
            found.append(saved)
        found += self._requested.changes(t_ns)
        self._find_active()
        return found
