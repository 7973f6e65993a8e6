"""The files that a run keeps in the folder of recordings: their names and order, and when one follows another.

Names begin with a number that increases in the folder, because the wall clock of a robot without a battery may be
behind. Several daemons may share the folder: each holds a lock file while it runs, and no other deletes its recordings.
"""

from __future__ import annotations

import fcntl
import logging
import os
import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from threading import Lock, Thread

from slipd.config import Continuous
from slipd.events import FirstEvents, Record, RecordingChanged
from slipd.recording.requested_recordings import RequestedRecordings
from slipd.recording.writer import Recorder
from slipd.requests.recording_state import utc_stamp
from slipd.types.clocks import WallClock

_NAME = re.compile(r"(?P<kind>[a-z]+)-(?:(?P<number>\d{6,})-)?\d{8}T\d{6}Z-(?P<rest>.+)\.mcap")
"""Recordings of this daemon; those of slipd 0.1 have no number, and are older than all that have one."""

_LOCK = re.compile(r"\.run-(?P<boot>\w+)\.lock")

CLOSE_LIMIT_S = 1.0
"""Longest wait for the disk when the lock file is removed; the next run removes one that was left."""

RETRY_NS = 60_000_000_000
"""Time from the failure of a file to the next attempt, ns."""

KIND = "run"

_log = logging.getLogger(__name__)


class RunFiles:
    """The recordings of one run in a folder. All methods may wait for the disk, and may be called from several threads.

    Args:
        folder: The folder; it need not exist before the first call.
        boot: Id of the run, a part of the names of its files.
    """

    def __init__(self, folder: Path, boot: str) -> None:
        self.folder = folder
        self._boot = boot
        self._mutex = Lock()
        self._lock_fd: int | None = None

    def place(self, path: Path) -> Path:
        """Return the path with the next number of its kind: ``run-<rest>`` becomes ``run-000042-<rest>``."""
        kind, _, rest = path.name.partition("-")
        newest = max((number for number, _ in self._numbered(kind)), default=-1)
        return path.with_name(f"{kind}-{max(newest, 0) + 1:06}-{rest}")

    def delete_oldest(self, kind: str, keep_files: int, keep_bytes: float = float("inf")) -> None:
        """Delete the oldest files of a kind, so that no more than some files and bytes remain.

        Files of other runs that still run are neither deleted nor counted. A file that cannot be deleted stays.
        """
        others = self._other_runs()
        kept = kept_bytes = 0
        for _, path in sorted(self._numbered(kind), reverse=True):
            if not others.isdisjoint(path.stem.split("-")):
                continue
            with suppress(OSError):
                kept, kept_bytes = kept + 1, kept_bytes + path.stat().st_size
                if kept > keep_files or kept_bytes > keep_bytes:
                    path.unlink()
                    _log.info("%s: deleted, it was the oldest", path)

    def close(self) -> None:
        """End the ownership: from now on other runs may delete the files."""
        if self._lock_fd is not None:
            thread = Thread(target=self._unlock, args=(self._lock_fd,), name="run files", daemon=True)
            self._lock_fd = None
            thread.start()
            thread.join(CLOSE_LIMIT_S)

    def _unlock(self, lock_fd: int) -> None:
        with suppress(OSError):
            self._lock_path.unlink()
        os.close(lock_fd)

    @property
    def _lock_path(self) -> Path:
        return self.folder / f".run-{self._boot}.lock"

    def _numbered(self, kind: str) -> list[tuple[int, Path]]:
        """Return the files of a kind with their numbers; -1 for a file without one."""
        found = [(_NAME.fullmatch(path.name), path) for path in self.folder.iterdir()]
        return [(int(match["number"] or -1), path) for match, path in found if match and match["kind"] == kind]

    def _other_runs(self) -> set[str]:
        """Hold the own lock; return the other runs that hold theirs, and remove lock files that were left."""
        with self._mutex:
            if self._lock_fd is None:
                with suppress(OSError):
                    self._lock_fd = _locked(self._lock_path, os.O_CREAT)
        alive = set()
        for path in self.folder.iterdir():
            match = _LOCK.fullmatch(path.name)
            if match is None or match["boot"] == self._boot:
                continue
            try:
                left_fd = _locked(path)
            except FileNotFoundError:
                continue
            except OSError:  # locked, or a disk that cannot tell
                alive.add(match["boot"])
                continue
            with suppress(OSError):
                path.unlink()
            os.close(left_fd)
        return alive


def _locked(path: Path, flags: int = 0) -> int:
    """Open and lock a file.

    Raises:
        OSError: Another run holds it, it is missing, or the disk cannot lock.
    """
    while True:
        lock_fd = os.open(path, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW | flags, 0o600)
        try:
            fcntl.flock(lock_fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.fstat(lock_fd).st_nlink:
                return lock_fd
        except BaseException:
            os.close(lock_fd)
            raise
        os.close(lock_fd)  # another run took it for a left one, and removed it


class ContinuousRecording(RequestedRecordings):
    """Records the whole run in files that follow each other, each complete by itself; nothing is lost in between.

    A new file begins when the present one is old or large enough.

    Args:
        directory: Folder of the files.
        make: Returns the recorder of a file that its thread creates.
        limits: ``[recording.continuous]``.
        name: Returns the name of a file that begins at a time, without kind, number and suffix.
    """

    def __init__(
        self,
        directory: Path,
        make: Callable[[Path], Recorder],
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
        if any(change.state != "running" for change in changes):
            self._due_ns = t_ns + RETRY_NS
        elif self._due_ns is None or t_ns >= self._due_ns or self.size_bytes >= self._limits.file_bytes:
            self._count += 1
            self._name = f"{KIND}-{self._name_at(t_ns)}-{self._count:04}.mcap"
            self._due_ns = t_ns + round(self._limits.file_s * 1e9)
            self.handle(Record(self._name, first()), t_ns)
        return [replace(change, name="") for change in changes]


def run_name(boot: str, wall: WallClock) -> Callable[[int], str]:
    """Return what names a file of a run by the time at which it begins."""
    return lambda t_ns: f"{utc_stamp(wall.at_ns(t_ns))}-{boot}"
