"""The files that a run keeps in the folder of recordings: their names and order, and when one follows another.

Names begin with a number that increases in the folder, because the wall clock of a robot without a battery may be
behind. Several daemons may share the folder: each holds a lock file while it runs, and no other deletes its recordings.
"""

from __future__ import annotations

import fcntl
import logging
import os
import re
import stat
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Lock, Thread

from slipd.errors import RecordingError
from slipd.recording.mcap_file import RecordingFile

_NAME = re.compile(r"(?P<kind>[a-z]+)-(?P<number>\d{6,})-\d{8}T\d{6}Z-.+\.mcap")
_LOCK = re.compile(r"\.run-(?P<boot>\w+)\.lock")

CLOSE_LIMIT_S = 1.0
"""Longest wait for the disk when the lock file is removed; the next run removes one that was left."""

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


class RecordingLimitError(RecordingError):
    """A limit of the config forbids a recording to start or to continue."""


@dataclass(frozen=True, slots=True)
class DiskLimits:
    """Limits on the disk space of a recording; reaching one ends the recording in good order.

    Attributes:
        max_bytes: Size of the file, bytes.
        min_free_bytes: Least free space of its disk, bytes.
    """

    max_bytes: int
    min_free_bytes: int

    def check(self, file: RecordingFile) -> None:
        """Check a file against the limits.

        Raises:
            RecordingLimitError: A limit is reached.
        """
        if file.tell() >= self.max_bytes:
            raise RecordingLimitError(f"the recording reached recording.max_bytes, {self.max_bytes}")
        self.check_disk(file.path)

    def check_disk(self, place: Path) -> None:
        """Check the free space of the disk of a file or folder.

        Raises:
            RecordingLimitError: There is too little.
            OSError: The disk cannot tell.
        """
        disk = os.statvfs(place)
        free_bytes = disk.f_bavail * disk.f_frsize
        if free_bytes < self.min_free_bytes:
            raise RecordingLimitError(
                f"the disk has {free_bytes} free bytes, less than recording.min_free_bytes, {self.min_free_bytes}"
            )


def check_folder(directory: Path, limits: DiskLimits, max_files: int) -> None:
    """Check the number of recordings in a directory and the free space of its disk.

    Raises:
        RecordingLimitError: A limit forbids another recording; the text says how to make room.
        RecordingError: The directory cannot be read.
    """
    try:
        files = sum(entry.name.startswith("slipd-") and entry.name.endswith(".mcap") for entry in os.scandir(directory))
        limits.check_disk(directory)
    except OSError as error:
        raise RecordingError(f"{directory}: cannot be read: {error.strerror}") from error
    if files >= max_files:
        raise RecordingLimitError(
            f"{directory} holds {files} recordings, and recording.max_files is {max_files}: move or delete some"
        )


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
        newest = max((number for number, _ in self._numbered(kind)), default=0)
        return path.with_name(f"{kind}-{newest + 1:06}-{rest}")

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
        """Return the files of a kind with their numbers."""
        found = [(_NAME.fullmatch(path.name), path) for path in self.folder.iterdir()]
        return [(int(match["number"]), path) for match, path in found if match and match["kind"] == kind]

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
