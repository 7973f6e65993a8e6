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
from collections.abc import Callable, Iterable, Mapping

from slipd.io.transport import Links
from slipd.io.zmtp.listener import Listener

ANSWER_S = 0.5
"""Longest wait for the greeting of an own endpoint, s: several times what a loaded machine needs."""

FEEDS_PER_TIMEOUT = 4
"""Feeds within the timeout of the watchdog: one may fail, as for a stage that was looked at between two of its steps,
even if every endpoint is waited for."""

_log = logging.getLogger(__name__)


class SystemdNotifier:
    """Reports to the service manager; does nothing where none started this process.

    Args:
        environment: Variables that the service manager set: ``NOTIFY_SOCKET``, ``WATCHDOG_USEC``, ``WATCHDOG_PID``.

    Attributes:
        watchdog_s: Time within which ``WATCHDOG=1`` must be sent again, s; None: there is no watchdog.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        microseconds = environment.get("WATCHDOG_USEC", "")
        for_this = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        watched = bool(self._address) and for_this and microseconds.isdecimal() and int(microseconds) > 0
        self.watchdog_s = int(microseconds) * 1e-6 if watched else None

    def send(self, *lines: str) -> None:
        """Send lines such as ``READY=1``, as sd_notify(3) explains them."""
        if not self._address:
            return
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)  # a service manager that hangs must not stop the daemon
            sender.sendto("\n".join(lines).encode(), self._address)


async def watch_stages(
    feed: Callable[[], None],
    timeout_s: float,
    links: Links,
    tick_count: Callable[[], int],
    listeners: Iterable[Listener],
) -> None:
    """Feed the watchdog for as long as every stage makes progress, until cancelled.

    Args:
        feed: Feeds the watchdog.
        timeout_s: Time after which an unfed watchdog ends the process, s.
        links: The links to the devices.
        tick_count: Returns how many ticks the engine has handled.
        listeners: The publisher and the request server.
    """
    ticks = tick_count()
    while True:
        await asyncio.sleep(timeout_s / FEEDS_PER_TIMEOUT)
        before, ticks = ticks, tick_count()
        stalls = [f"bytes of {name} are not read" for name in links.unread()]
        if ticks == before:
            stalls.append("the engine handles no ticks")
        stalls += [why for listener in listeners if (why := await listener.stall(ANSWER_S))]
        if stalls:
            _log.error("%s: the watchdog is not fed: no progress (%s)", "watchdog", "; ".join(stalls))
        else:
            feed()
