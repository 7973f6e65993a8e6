"""What to look at where nobody answers at an endpoint."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from pathlib import Path

SERVICE_DIR = Path("/run/slipd")
"""Where the systemd service of slipd has its sockets."""


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
