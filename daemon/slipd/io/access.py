"""Who may connect: the keys of each endpoint, and the directory of the sockets.

The directory is for the user of the daemon, optionally for one group, and for one daemon at a time: a second bind to
the path of an ipc socket would silently take it from the first daemon, so a lock comes first.
"""

from __future__ import annotations

import fcntl
import grp
import os
import stat
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from zmq.utils import z85

from slipd.config import Bus
from slipd.config.checks import missing_keys
from slipd.errors import LinkError
from slipd.io.zmtp.endpoint import Access
from slipd_client.keys import KeyFileError, load_allowed, load_secret

MAX_PID_BYTES = 20
"""Most digits of a process id, with a margin."""

LOCK_NAME = "lock"

GROUP = "slipd"
"""Members of this group may connect; if the machine has no such group or the daemon is not a member, only its user
may."""

ANOTHER = "name another directory with SLIPD_RUNTIME_DIR"


@dataclass(frozen=True, slots=True)
class Guard:
    """Access to both endpoints.

    Attributes:
        publish: Who may connect to the publish endpoint.
        requests: Who may connect to the request endpoint.
        requesters: The keys that may send requests; None: every connected client may.
    """

    publish: Access
    requests: Access
    requesters: frozenset[bytes] | None


def guard(bus: Bus) -> Guard:
    """Read the keys that the config names.

    The key of a reader may connect to the request endpoint too, where its requests get an error.

    Raises:
        LinkError: A key file cannot be used; the text has the reason, and how to create one that is missing.
    """
    if missing := list(missing_keys(bus)):
        raise LinkError("; ".join(f"{key}: {text}" for key, text in missing))
    try:
        secret = None if bus.secret_key is None else z85.decode(load_secret(bus.secret_key)[1])
        readers = None if bus.readers is None else load_allowed(bus.readers)
        requesters = None if bus.requesters is None else load_allowed(bus.requesters)
    except KeyFileError as error:
        raise LinkError(str(error)) from error
    lists = (readers, None if requesters is None else requesters | (readers or frozenset()))
    publish, requests = (
        Access(bus.allow_local_tcp) if keys is None else Access(bus.allow_local_tcp, secret, keys) for keys in lists
    )
    return Guard(publish, requests, requesters)


class RuntimeDirectory(ExitStack):
    """The directory of the daemon, locked by one process for the duration of ``with``.

    The kernel releases the lock when the process ends, in any way.

    Args:
        path: The directory; created if missing, with mode 0750 if the daemon is a member of the group, else with 0700.
            An existing directory keeps its mode.
        group: Name of the group that may enter.

    Raises:
        LinkError: On entry: another process holds the lock, other users may enter or change the directory, or it cannot
            be created.
    """

    def __init__(self, path: Path, group: str = GROUP) -> None:
        super().__init__()
        self.path = path
        self._group = _group_id(group)
        self._group_name = group

    def __enter__(self) -> Self:
        try:
            self._make()
            self._check_private()
            self.callback(os.close, self._lock_directory())
        except OSError as error:
            raise LinkError(
                f"{self.path}: cannot be used as the runtime directory: {error.strerror}; {ANOTHER}"
            ) from error
        return self

    def share(self, endpoint: str) -> None:
        """Let the group use a socket of the directory; if no group may enter, or the socket is elsewhere, do nothing.

        Raises:
            LinkError: The group of the socket cannot be set.
        """
        socket = Path(endpoint.removeprefix("ipc://"))
        if socket.parent != self.path or not self.path.stat().st_mode & stat.S_IXGRP:
            return
        try:
            _give_to_group(socket, self.path.stat().st_gid, 0o660)
        except OSError as error:
            raise LinkError(f"{endpoint}: cannot be shared with group {self._group_name}: {error}") from error

    def _make(self) -> None:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.mkdir(mode=0o700)
        except FileExistsError:
            return
        if self._group is not None:
            _give_to_group(self.path, self._group, 0o750)

    def _check_private(self) -> None:
        found = self.path.lstat()
        mode = stat.S_IMODE(found.st_mode)
        if not stat.S_ISDIR(found.st_mode):
            raise LinkError(f"{self.path}: must be a directory, not a link or file; remove it, or {ANOTHER}")
        if found.st_uid != os.geteuid():
            raise LinkError(f"{self.path}: must belong to user {os.geteuid()}, got user {found.st_uid}; {ANOTHER}")
        if mode & 0o027:
            raise LinkError(
                f"{self.path}: others may enter or change it (mode {mode:04o}); run chmod 700 on it, or {ANOTHER}"
            )
        if mode & 0o050 and found.st_gid != self._group:
            raise LinkError(
                f"{self.path}: no group may enter it (mode {mode:04o}) except {self._group_name} with this user as a"
                f" member; run chmod 700 on it, or {ANOTHER}"
            )

    def _lock_directory(self) -> int:
        lock = os.open(self.path / LOCK_NAME, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(lock, MAX_PID_BYTES).decode(errors="replace").strip() or "unknown"
            os.close(lock)
            raise LinkError(
                f"{self.path}: another slipd uses this directory (process {holder}); stop it, or {ANOTHER}"
            ) from FileExistsError()
        os.ftruncate(lock, 0)
        os.write(lock, f"{os.getpid()}\n".encode())
        return lock


def _give_to_group(path: Path, group: int, mode: int) -> None:
    """Set group and mode; a path that belongs to the group already is not given, which the systemd unit forbids."""
    if path.stat().st_gid != group:
        os.chown(path, -1, group)
    path.chmod(mode)


def _group_id(name: str) -> int | None:
    """Return the id of the group; None if it does not exist or this process cannot give files to it."""
    try:
        number = grp.getgrnam(name).gr_gid
    except KeyError:
        return None
    return number if os.geteuid() == 0 or number in {os.getegid(), *os.getgroups()} else None
