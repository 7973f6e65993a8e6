"""Default endpoints of the daemon and its clients, and what to look at where nobody answers there."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from pathlib import Path

SERVICE_DIR = Path("/run/slipd")
"""Where the systemd service of slipd has its sockets."""


def runtime_dir() -> Path:
    """Return the directory of the daemon's sockets; it need not exist yet.

    ``$SLIPD_RUNTIME_DIR`` where set, else ``$XDG_RUNTIME_DIR/slipd``, else ``/tmp/slipd-<uid>``. Whoever creates it
    must own it and keep others from writing to it, because anyone may create names in ``/tmp``.
    """
    if chosen := os.environ.get("SLIPD_RUNTIME_DIR"):
        return Path(chosen)
    if session := os.environ.get("XDG_RUNTIME_DIR"):
        return Path(session) / "slipd"
    return Path(f"/tmp/slipd-{os.getuid()}")  # noqa: S108 - daemon and clients check its owner (path_trust)


def log_file() -> Path:
    """Return the file in which a daemon keeps its log while no journal does; the log before it ends in ``.1``."""
    return runtime_dir() / "log"


def publish_endpoint() -> str:
    """Return the ZeroMQ endpoint of the messages when none is configured."""
    return f"ipc://{runtime_dir()}/publish"


def requests_endpoint() -> str:
    """Return the ZeroMQ endpoint of the requests when none is configured."""
    return f"ipc://{runtime_dir()}/requests"


def hint_for(endpoint: str) -> str:
    """Return a sentence that says why nobody may answer at an endpoint, and what to do about it."""
    if endpoint.startswith("tcp:"):
        return "Is slipd running, and are the keys right?"
    directory = Path(endpoint.removeprefix("ipc://")).parent
    try:
        found = directory.stat()
    except OSError:
        if directory != SERVICE_DIR and SERVICE_DIR.is_dir():
            return f"Is slipd running? A service uses {SERVICE_DIR}: for that one set SLIPD_RUNTIME_DIR={SERVICE_DIR}"
        return "Is slipd running?"
    if os.access(directory, os.X_OK):
        return "Is slipd running?"
    return _who_may_enter(directory, found)


def _who_may_enter(directory: Path, found: os.stat_result) -> str:
    if not found.st_mode & stat.S_IXGRP:
        return f"Only {_name(directory.owner, f'user {found.st_uid}')} may enter {directory}"
    group = _name(directory.group, str(found.st_gid))
    return f"Only the group {group} may enter {directory}: sudo usermod -aG {group} $USER, then log in again"


def _name(known: Callable[[], str], number: str) -> str:
    """Return the name of an owner or group, or its number where this machine has no name for it."""
    try:
        return known()
    except KeyError:
        return number
