"""Recordings that clients request, in a directory of the daemon under names that the daemon chooses.

Even the file is created on the thread of the recorder: a client must not be able to make the live path wait for a disk.
"""

from __future__ import annotations

import logging
import os
import stat
import time
from collections.abc import Callable
from pathlib import Path

from slipd.errors import RecordingError
from slipd.events import Event, Record, RecordingChanged
from slipd.recording.mcap_file import EVENTS
from slipd.recording.writer import CLOSE_LIMIT_S, Recorder, RecordingLimitError, Room

MOST_UNFINISHED = 2
"""Ended recordings that may still be written when another starts; each holds a thread and up to 30 MB."""

LOSSES_PERIOD_NS = 1_000_000_000
"""Shortest time between two reports of lost entries."""

START_LIMIT_NS = 500_000_000
"""How long the disk may take to create a file before its recording is given up."""

_log = logging.getLogger(__name__)


def state_dir() -> Path:
    """Return the directory of requested recordings; it need not exist yet.

    ``$SLIPD_STATE_DIR`` if set, else ``$XDG_STATE_HOME/slipd``, else ``~/.local/state/slipd``.
    """
    if chosen := os.environ.get("SLIPD_STATE_DIR"):
        return Path(chosen)
    state = os.environ.get("XDG_STATE_HOME")
    return (Path(state) if state else Path.home() / ".local" / "state") / "slipd"


def private_directory(path: Path) -> None:
    """Create a directory to which only this user can write, or check that an existing one is such a directory.

    Raises:
        RecordingError: It cannot be created, or other users could replace its files.
    """
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = path.lstat()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be created: {error.strerror}") from error
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid() or found.st_mode & 0o022:
        raise RecordingError(f"{path}: must be a directory of user {os.geteuid()} to which nobody else can write")


def check_room(directory: Path, room: Room, max_files: int) -> None:
    """Check the number of recordings in a directory and the free space of its disk.

    Raises:
        RecordingLimitError: A limit forbids another recording; the text says how to make room.
        RecordingError: The directory cannot be read.
    """
    try:
        files = sum(entry.name.startswith("slipd-") and entry.name.endswith(".mcap") for entry in os.scandir(directory))
        room.check_disk(directory)
    except OSError as error:
        raise RecordingError(f"{directory}: cannot be read: {error.strerror}") from error
    if files >= max_files:
        raise RecordingLimitError(
            f"{directory} holds {files} recordings, and recording.max_files is {max_files}: move or delete some"
        )


class RecorderWatch:
    """Polls a recorder; each change is logged and returned once.

    Args:
        name: Name of the recording, "" for that of the whole run.
        recorder: The recorder.
        t_ns: When it was started, CLOCK_MONOTONIC.
    """

    def __init__(self, name: str, recorder: Recorder, t_ns: int) -> None:
        self.recorder = recorder
        self._name = name
        self._started_ns = t_ns
        self._reported: RecordingChanged | None = None
        self._losses_due_ns = t_ns

    @property
    def over(self) -> bool:
        """Whether the end of a recording that ended by itself has been reported."""
        return self._reported is not None and self._reported.state != "running"

    def poll(self, t_ns: int) -> RecordingChanged | None:
        """Return what changed since the last report; None if nothing did.

        A file that the disk does not create in time is given up; its recorder removes it as soon as it can.
        """
        change = self._state(t_ns)
        before = self._reported
        if change is None or change == before or self.over:  # `close` reports what is lost after the end
            return None
        if before is not None and change.state == before.state and t_ns < self._losses_due_ns:
            return None
        self._reported = change
        self._losses_due_ns = t_ns + LOSSES_PERIOD_NS
        _log_change(change)
        return change

    def close(self, within_s: float = CLOSE_LIMIT_S) -> None:
        """Finish the recorder, and log what was lost.

        Args:
            within_s: How long the disk may take, s.

        Raises:
            RecordingError: The disk failed, now or before.
        """
        recorder = self.recorder
        recorder.close(within_s)
        if recorder.lost:
            line = "%s: %d entries are missing: the disk was too slow"
            _log.warning(line, recorder.path, recorder.lost, extra={"slipd_recording": recorder.path})

    def _state(self, t_ns: int) -> RecordingChanged | None:
        recorder, name, path = self.recorder, self._name, str(self.recorder.path)
        state, reason = recorder.outcome
        if state != "starting":
            return RecordingChanged(name, path, state, reason, recorder.lost)
        if t_ns - self._started_ns < START_LIMIT_NS:
            return None
        recorder.discard()
        reason = f"{path}: the disk did not create the file within {START_LIMIT_NS * 1e-9:g} s"
        return RecordingChanged(name, path, "failed", reason)


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


class RequestedRecordings:
    """Start and end recordings as the engine orders, one at a time.

    No method raises because of a disk, and only `close` waits for one.

    Args:
        directory: Folder of the files.
        make: Returns the recorder of a file that its thread creates.
    """

    def __init__(self, directory: Path, make: Callable[[Path], Recorder]) -> None:
        self._directory = directory
        self._make = make
        self._ended: list[RecorderWatch] = []
        self._refused: list[RecordingChanged] = []
        self._running: RecorderWatch | None = None

    def handle(self, record: Record, t_ns: int) -> None:
        """Start a recording, or end the running one; `changes` returns the outcome."""
        if self._running is not None:
            self._running.recorder.end()
            self._ended.append(self._running)
            self._running = None
        if record.name:
            path = self._directory / record.name
            try:
                recorder = self._start(path)
            except (RecordingError, RuntimeError) as error:  # RuntimeError: the system starts no more threads
                _log.warning("%s: %s", path, error, extra={"slipd_recording": path, "slipd_fault": "recording-failed"})
                self._refused.append(RecordingChanged(record.name, str(path), "failed", f"{path}: {error}"))
                return
            self._running = RecorderWatch(record.name, recorder, t_ns)
            for event in record.opened:
                recorder.add(EVENTS, event, t_ns)

    def _start(self, path: Path) -> Recorder:
        if sum(not watch.recorder.finished for watch in self._ended) > MOST_UNFINISHED:
            raise RecordingError("the disk is still writing earlier recordings; try again later")
        return self._make(path)

    def add(self, topic: str, content: Event | bytes, t_ns: int) -> None:
        """Record an event that enters the engine at ``t_ns``, or the bytes that were published because of it."""
        if self._running is not None:
            self._running.recorder.add(topic, content, t_ns)

    @property
    def size_bytes(self) -> int:
        """Size of the running recording, bytes; 0 where none runs."""
        return 0 if self._running is None else self._running.recorder.size_bytes

    def changes(self, t_ns: int) -> list[RecordingChanged]:
        """Return the changes that the engine must know, each once."""
        done = [
            watch for watch in self._ended if watch.recorder.finished
        ]  # checked first, so that their last change is final
        changes = [*(change for watch in self._ended if (change := watch.poll(t_ns))), *self._refused]
        self._refused.clear()
        self._ended = [watch for watch in self._ended if watch not in done]
        if self._running is not None and (change := self._running.poll(t_ns)):
            changes.append(change)
            if change.state != "running":
                self.handle(Record(""), t_ns)
        return changes

    def close(self) -> None:
        """Finish every file; wait at most `CLOSE_LIMIT_S` in total for a disk that hangs."""
        self.handle(Record(""), 0)
        end_s = time.monotonic() + CLOSE_LIMIT_S
        for watch in self._ended:
            try:
                watch.close(max(0.0, end_s - time.monotonic()))
            except RecordingError as error:
                if not watch.over:
                    _log.error("%s", error)
