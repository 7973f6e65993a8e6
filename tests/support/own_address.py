"""A loopback address of this process alone: a port that it found free there is not taken by another test meanwhile."""

from __future__ import annotations

import os
import socket


def own_host() -> str:
    """Return the address, which follows from the process id: no two processes have the same one."""
    number = os.getpid()
    return f"127.{64 + (number >> 16) % 128}.{number >> 8 & 255}.{number & 255}"


def free_port() -> int:
    """Return a port on which nobody listens at that address."""
    with socket.socket() as found:
        found.bind((own_host(), 0))
        return int(found.getsockname()[1])
