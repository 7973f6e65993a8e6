"""Recordings that a client asked for, in the daemon's own directory under names of its own.

Even to create the file is left to the writer's thread: a client must not be able to make the live path wait for a disk.
"""

from __future__ import annotations

import logging
import os
import stat
from collections.abc import Callable
from pathlib import Path

from slipd.errors import RecordingError
from slipd.pipeline.events import Event, Record, RecordingFailed
from slipd.recording.writer import Recorder

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
        self.running: Recorder | None = None

    def take(self, record: Record, t_ns: int) -> None:
        """Begins a recording, or ends the one that runs."""
        if self.running is not None:
            self.running.end()
            self._ended.append(self.running)
            self.running = None
        if record.name:
            path = self._directory / record.name
            self.running = self._make(path, lambda: private_directory(self._directory))
            for event in record.opened:
                self.running.event(event, t_ns)

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
        recorder = self.running
        if recorder is None or recorder.failure is None or recorder is self._told:
            return None
        self._told = recorder
        _log.warning("%s", recorder.failure)
        return RecordingFailed(recorder.path.name, recorder.failure)

    def close(self) -> None:
        """Finishes every file."""
        self.take(Record(""), 0)
        for recorder in self._ended:
            try:
                recorder.close()
            except RecordingError as error:
                if recorder is not self._told:
                    _log.warning("%s", error)
