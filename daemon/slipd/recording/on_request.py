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
from slipd.pipeline.events import Event, Record, RecordingFailed
from slipd.recording.writer import CLOSE_LIMIT_S, Recorder

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


class RequestedRecordings:
    """Writes what the engine says is to be recorded, one file at a time.

    Nothing here raises for a disk, and nothing waits for one but `close`.

    Args:
        directory: Where the files go.
        make: Makes the recorder of a file, given its path and what is to be done first on the recorder's thread.
    """

    def __init__(self, directory: Path, make: Callable[[Path, Callable[[], None]], Recorder]) -> None:
        self._directory = directory
        self._make = make
        self._ended: list[Recorder] = []
        self._told: Recorder | None = None
        self._refused: RecordingFailed | None = None
        self.running: Recorder | None = None

    def take(self, record: Record, t_ns: int) -> None:
        """Begins a recording, or ends the one that runs; one that cannot be begun is `failed`."""
        if self.running is not None:
            self.running.end()
            self._ended.append(self.running)
            self.running = None
        if record.name:
            try:
                self.running = self._begin(self._directory / record.name)
            except (RecordingError, RuntimeError) as error:  # the latter: the system gives no more threads
                self._refused = RecordingFailed(record.name, str(error))
                return
            for event in record.opened:
                self.running.event(event, t_ns)

    def _begin(self, path: Path) -> Recorder:
        for recorder in [ended for ended in self._ended if ended.finished]:
            self._ended.remove(recorder)
            self._close(recorder, 0.0)
        if len(self._ended) > MOST_UNFINISHED:
            raise RecordingError(f"{path}: the disk has not taken the recordings before this one yet; ask again later")
        return self._make(path, lambda: private_directory(self._directory))

    def record_event(self, event: Event, t_ns: int) -> None:
        """Records an event that enters the engine at ``t_ns``."""
        if self.running is not None:
            self.running.event(event, t_ns)

    def record_published(self, topic: str, payload: bytes, t_ns: int) -> None:
        """Records the very bytes that were published."""
        if self.running is not None:
            self.running.published(topic, payload, t_ns)

    def failed(self) -> RecordingFailed | None:
        """What the engine must know: the recording that runs cannot go on; told once."""
        if self._refused is not None:
            refused, self._refused = self._refused, None
            _log.warning("%s", refused.reason)
            return refused
        recorder = self.running
        if recorder is None or recorder.failure is None or recorder is self._told:
            return None
        self._told = recorder
        _log.warning("%s", recorder.failure)
        return RecordingFailed(recorder.path.name, recorder.failure)

    def close(self) -> None:
        """Finishes every file; a disk that hangs is waited for `CLOSE_LIMIT_S` in all."""
        self.take(Record(""), 0)
        end_s = time.monotonic() + CLOSE_LIMIT_S
        for recorder in self._ended:
            self._close(recorder, max(0.0, end_s - time.monotonic()))

    def _close(self, recorder: Recorder, within_s: float) -> None:
        try:
            recorder.close(within_s)
        except RecordingError as error:
            if recorder is not self._told:
                _log.warning("%s", error)
