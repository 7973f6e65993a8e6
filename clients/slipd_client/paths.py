"""Default endpoints of the daemon and its clients. The daemon imports this too."""

from __future__ import annotations

import os
from pathlib import Path


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
