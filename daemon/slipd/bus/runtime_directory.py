"""The directory of the daemon's sockets: for its user, or for one group as well, and one daemon's at a time.

A second bind on the path of an ipc socket steals it from the first daemon without a word, so a lock comes before it.
"""

from __future__ import annotations

import fcntl
import grp
import os
import stat
from pathlib import Path
from types import TracebackType

from slipd.errors import LinkError

MAX_PID_BYTES = 20
"""Digits of a process id, generously."""

LOCK_NAME = "lock"

GROUP = "slipd"
"""Its members may read and request; where the machine has no such group, or the daemon is none, only its user may."""


class RuntimeDirectory:
    """The daemon's own directory, held by one process from ``with`` to its end.

    The lock is the kernel's: it ends with the process, however that dies.

    Args:
        path: Made where it is missing: with mode 0750 for the group where the daemon is a member, else with 0700. One
            that exists stays as it is.
        group: Name of the group that may enter.

    Raises:
        LinkError: On entry: another process holds it, others may enter or change it, or it cannot be made.
    """

    def __init__(self, path: Path, group: str = GROUP) -> None:
        self.path = path
        self._lock = -1
        self._group = _group_id(group)
        self._group_name = group

    def __enter__(self) -> RuntimeDirectory:
        try:
            self._make()
            self._check_private()
            self._lock = self._take_lock()
        except OSError as error:
            raise LinkError(f"{self.path}: cannot be used as the runtime directory: {error}") from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._lock)

    def share(self, endpoint: str) -> None:
        """Let the group use a socket that was bound within; where no group may enter, and elsewhere, nothing changes.

        Raises:
            LinkError: Its group cannot be set.
        """
        socket = Path(endpoint.removeprefix("ipc://"))
        if socket.parent != self.path or not self.path.stat().st_mode & stat.S_IXGRP:
            return
        try:
            os.chown(socket, -1, self.path.stat().st_gid)
            socket.chmod(0o660)
        except OSError as error:
            raise LinkError(f"{endpoint}: cannot be shared with group {self._group_name}: {error}") from error

    def _make(self) -> None:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.mkdir(mode=0o700)
        except FileExistsError:
            return
        if self._group is not None:
            os.chown(self.path, -1, self._group)
            self.path.chmod(0o750)

    def _check_private(self) -> None:
        found = self.path.lstat()
        mode = stat.S_IMODE(found.st_mode)
        if not stat.S_ISDIR(found.st_mode):
            raise LinkError(f"{self.path}: is no directory of its own; name one that is, or remove it")
        if found.st_uid != os.geteuid():
            raise LinkError(f"{self.path}: belongs to user {found.st_uid}; name a directory of user {os.geteuid()}")
        if mode & 0o027:
            raise LinkError(
                f"{self.path}: others may enter or change it (mode {mode:04o}); run chmod 700 on it, or name another"
            )
        if mode & 0o050 and found.st_gid != self._group:
            raise LinkError(
                f"{self.path}: a group may enter it (mode {mode:04o}) that is not {self._group_name}, or that this user"
                " is no member of; run chmod 700 on it, or name another"
            )

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


def _group_id(name: str) -> int | None:
    """The group's number, where it exists and this process may give files to it."""
    try:
        number = grp.getgrnam(name).gr_gid
    except KeyError:
        return None
    return number if os.geteuid() == 0 or number in {os.getegid(), *os.getgroups()} else None
