"""Report to systemd, and feed its watchdog only while every stage of the daemon makes progress.

The protocol is one datagram of ``KEY=VALUE`` lines (sd_notify). The bindings of systemd need a compiler, and the others
are a dependency for twenty lines. A thread of its own, or a bare timer, would feed the watchdog while nothing is read.
So the loop feeds it, after each stage has shown progress since the last time: lines read, the engine stepped, messages
sent, requests taken.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import socket
import time
from collections.abc import Awaitable, Callable, Mapping

from slipd.errors import one_line
from slipd.io.transport import Links
from slipd.io.zmtp.listener import Listener

ANSWER_S = 0.5
"""Longest wait for the greeting of an own endpoint, s: several times what a loaded machine needs."""

FEEDS_PER_TIMEOUT = 4
"""Feeds within the timeout of the watchdog: one may fail, as for a stage that was looked at between two of its steps,
even if every endpoint is waited for."""

Check = Callable[[], Awaitable[str]]
"""Returns why a stage made no progress since the last call; "" if it did."""

_log = logging.getLogger(__name__)


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


async def watch_stages(feed: Callable[[], None], timeout_s: float, stages: Mapping[str, Check]) -> None:
    """Feed the watchdog for as long as every stage makes progress, until cancelled.

    Args:
        feed: Feeds the watchdog.
        timeout_s: Time after which an unfed watchdog ends the process, s.
        stages: Check of each stage, by name.
    """
    while True:
        await asyncio.sleep(timeout_s / FEEDS_PER_TIMEOUT)
        stalled = [f"{name}: {why}" for name, check in stages.items() if (why := await check())]
        if stalled:
            _log.error("%s: the watchdog is not fed: no progress (%s)", "watchdog", "; ".join(stalled))
        else:
            feed()


def stage_checks(
    links: Links, tick_count: Callable[[], int], publisher: Listener, requests: Listener
) -> dict[str, Check]:
    """Return the check of each stage.

    Args:
        links: The links to the devices.
        tick_count: Returns how many ticks the engine has handled.
        publisher: The publisher.
        requests: The request server.
    """
    seen = tick_count()

    async def check_links() -> str:
        unread = links.unread()
        return f"bytes of {', '.join(unread)} are not read" if unread else ""

    async def check_engine() -> str:
        nonlocal seen
        before, seen = seen, tick_count()
        return "" if seen > before else "it handles no ticks"

    return {
        "links": check_links,
        "engine": check_engine,
        "publishing": lambda: publisher.stall(ANSWER_S),
        "requests": lambda: requests.stall(ANSWER_S),
    }
