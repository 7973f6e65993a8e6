"""Recordings that a client asked for, in the daemon's own directory under names of its own.

Even to create the file is left to the writer's thread: a client must not be able to make the live path wait for a disk.
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
from slipd.recording.recorder_watch import RecorderWatch
from slipd.recording.writer import CLOSE_LIMIT_S, Recorder, RecordingLimitError, Room

MOST_UNFINISHED = 2
"""Ended files that the disk may still be taking when another is begun: each holds a thread and up to 30 MB."""

_log = logging.getLogger(__name__)


def state_dir() -> Path:
    """Directory of the recordings that clients ask for; it need not exist yet.

    ``$SLIPD_STATE_DIR`` where set, else ``$XDG_STATE_HOME/slipd``, else ``~/.local/state/slipd``.
    """
    if chosen := os.environ.get("SLIPD_STATE_DIR"):
        return Path(chosen)
    state = os.environ.get("XDG_STATE_HOME")
    return (Path(state) if state else Path.home() / ".local" / "state") / "slipd"


def private_directory(path: Path) -> None:
    """Makes a directory that only its user can write to, or sees that it is one.

    Raises:
        RecordingError: It cannot be made, or others could put something in the place of a file.
    """
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = path.lstat()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be made: {error.strerror}") from error
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid() or found.st_mode & 0o022:
        raise RecordingError(f"{path}: must be a directory of user {os.geteuid()} that nobody else can write to")


def check_room(directory: Path, room: Room, max_files: int) -> None:
    """Count the recordings of a directory, and look at the free space of its disk.

    Raises:
        RecordingLimitError: A limit does not let another recording begin; the text says how to make room.
        RecordingError: The directory cannot be read.
    """
    try:
        files = sum(entry.name.startswith("slipd-") and entry.name.endswith(".mcap") for entry in os.scandir(directory))
        disk = os.statvfs(directory)
    except OSError as error:
        raise RecordingError(f"{directory}: cannot be read: {error.strerror}") from error
    if files >= max_files:
        raise RecordingLimitError(
            f"{directory} holds {files} recordings, and recording.max_files is {max_files}: move or delete some"
        )
    free_bytes = disk.f_bavail * disk.f_frsize
    if free_bytes < room.min_free_bytes:
        raise RecordingLimitError(
            f"{directory}: only {free_bytes} bytes of the disk are free, and recording.min_free_bytes is"
            f" {room.min_free_bytes}: make room"
        )


class RequestedRecordings:
    """Writes what the engine says is to be recorded, one file at a time.

    Nothing here raises for a disk, and nothing waits for one but `close`.

    Args:
        directory: Where the files go.
        make: Makes the recorder of a file, given its path and what is to be done first on the recorder's thread.
        prepare: Done first on that thread: what it raises keeps the recording from beginning.
    """

    def __init__(
        self,
        directory: Path,
        make: Callable[[Path, Callable[[], None]], Recorder],
        prepare: Callable[[], None],
    ) -> None:
        self._directory = directory
        self._make = make
        self._prepare = prepare
        self._ended: list[RecorderWatch] = []
        self._refused: RecordingChanged | None = None
        self._running: RecorderWatch | None = None

    def take(self, record: Record, t_ns: int) -> None:
        """Begin a recording, or end the one that runs; what comes of it is in `news`."""
        if self._running is not None:
            self._running.recorder.end()
            self._ended.append(self._running)
            self._running = None
        if record.name:
            path = self._directory / record.name
            try:
                recorder = self._begin(path)
            except (RecordingError, RuntimeError) as error:  # the latter: the system gives no more threads
                _log.warning("%s: %s", path, error)
                self._refused = RecordingChanged(record.name, str(path), "failed", f"{path}: {error}")
                return
            self._running = RecorderWatch(record.name, recorder, t_ns)
            for event in record.opened:
                recorder.event(event, t_ns)

    def _begin(self, path: Path) -> Recorder:
        if sum(not watch.recorder.finished for watch in self._ended) > MOST_UNFINISHED:
            raise RecordingError("the disk has not taken the recordings before this one yet; ask again later")
        return self._make(path, self._prepare)

    def record_event(self, event: Event, t_ns: int) -> None:
        """Record an event that enters the engine at ``t_ns``."""
        if self._running is not None:
            self._running.recorder.event(event, t_ns)

    def record_published(self, topic: str, payload: bytes, t_ns: int) -> None:
        """Record the very bytes that were published."""
        if self._running is not None:
            self._running.recorder.published(topic, payload, t_ns)

    def news(self, t_ns: int) -> list[RecordingChanged]:
        """Return what the engine must know; each change once."""
        done = [watch for watch in self._ended if watch.recorder.finished]  # asked first: their last change is final
        news = [change for watch in self._ended if (change := watch.look(t_ns))]
        self._ended = [watch for watch in self._ended if watch not in done]
        if self._refused is not None:
            news.append(self._refused)
            self._refused = None
        if self._running is not None and (change := self._running.look(t_ns)):
            news.append(change)
            if change.state != "running":
                self.take(Record(""), t_ns)
        return news

    def close(self) -> None:
        """Finish every file; a disk that hangs is waited for `CLOSE_LIMIT_S` in all."""
        self.take(Record(""), 0)
        end_s = time.monotonic() + CLOSE_LIMIT_S
        for watch in self._ended:
            try:
                watch.close(max(0.0, end_s - time.monotonic()))
            except RecordingError as error:
                if not watch.over:
                    _log.error("%s", error)
