"""The directory of the daemon's sockets: its user's alone, and one daemon's at a time.

A second bind on the path of an ipc socket steals it from the first daemon without a word, so a lock comes before it.
"""

from __future__ import annotations

import fcntl
import os
import stat
from pathlib import Path
from types import TracebackType

from slipd.errors import LinkError

MAX_PID_BYTES = 20
"""Digits of a process id, generously."""

LOCK_NAME = "lock"


class RuntimeDirectory:
    """The daemon's own directory, held by one process from ``with`` to its end.

    The lock is the kernel's: it ends with the process, however that dies.

    Args:
        path: Made with mode 0700 where it is missing.

    Raises:
        LinkError: On entry: another process holds it, others may enter it, or it cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = -1

    def __enter__(self) -> RuntimeDirectory:
        try:
            self.path.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._check_private()
            self._lock = self._take_lock()
        except OSError as error:
            raise LinkError(f"{self.path}: cannot be used as the runtime directory: {error}") from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._lock)

    def _check_private(self) -> None:
        found = self.path.lstat()
        if not stat.S_ISDIR(found.st_mode):
            raise LinkError(f"{self.path}: is no directory of its own; name one that is, or remove it")
        if found.st_uid != os.geteuid():
            raise LinkError(f"{self.path}: belongs to user {found.st_uid}; name a directory of user {os.geteuid()}")
        if found.st_mode & 0o077:
            mode = stat.S_IMODE(found.st_mode)
            raise LinkError(f"{self.path}: others may enter it (mode {mode:04o}); run chmod 700 on it, or name another")

    def _take_lock(self) -> int:
        lock = os.open(self.path / LOCK_NAME, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(lock, MAX_PID_BYTES).decode(errors="replace").strip() or "unknown"
            os.close(lock)
            raise LinkError(
                f"{self.path}: slipd runs here already (process {holder}); stop it, or give this one another directory"
            ) from None
        os.ftruncate(lock, 0)
        os.write(lock, f"{os.getpid()}\n".encode())
        return lock
