"""Report to systemd: ready, reloading, stopping, a line of status, and the feeding of the watchdog.

The protocol is one datagram of ``KEY=VALUE`` lines (sd_notify). The bindings of systemd need a compiler, and the others
are a dependency for twenty lines.
"""

from __future__ import annotations

import contextlib
import os
import socket
import time
from collections.abc import Mapping

from slipd.types.device_text import one_line


class SystemdNotifier:
    """Reports to the service manager; does nothing where none started this process.

    Args:
        environment: Variables that the service manager set: ``NOTIFY_SOCKET``, ``WATCHDOG_USEC``, ``WATCHDOG_PID``.

    Attributes:
        watchdog_s: Time within which `feed` must be called again, s; None: there is no watchdog.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._status = ""
        microseconds = environment.get("WATCHDOG_USEC", "")
        for_this = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        watched = bool(self._address) and for_this and microseconds.isdecimal() and int(microseconds) > 0
        self.watchdog_s = int(microseconds) * 1e-6 if watched else None

    def ready(self) -> None:
        """Report that the daemon serves; also the end of a reload."""
        self._send("READY=1")

    def reloading(self) -> None:
        """Report that the daemon starts again with another config."""
        self._send("RELOADING=1", f"MONOTONIC_USEC={time.monotonic_ns() // 1000}")

    def stopping(self) -> None:
        """Report that the daemon ends."""
        self._send("STOPPING=1")

    def status(self, text: str) -> None:
        """Show a line in ``systemctl status``; sent only when it changes."""
        if self._address and text != self._status:
            self._status = text
            self._send(f"STATUS={one_line(text)}")

    def feed(self) -> None:
        """Report to the watchdog that the daemon makes progress."""
        self._send("WATCHDOG=1")

    def _send(self, *lines: str) -> None:
        if not self._address:
            return
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)  # a service manager that hangs must not stop the daemon
            sender.sendto("\n".join(lines).encode(), self._address)
