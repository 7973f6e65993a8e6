"""Keeps one link open for ever: what all transports share, whatever lies beneath.

A transport only opens a connection, moves bytes and says why it ended. When to try again, and what to tell of it,
is decided here once.
"""

from __future__ import annotations

import asyncio
import logging
import random
import time
from collections import deque
from collections.abc import Awaitable, Callable
from typing import NoReturn, Protocol

from slipd.errors import LinkError
from slipd.events import Bytes, Event, LinkDown, LinkSpec, LinkUp
from slipd.transport.tcp_inquiry import inquire

STEADY_S = 0.5
"""A connection that brought bytes for so long was well: the next pause is the first again."""

FIRST_DELAY_S = 0.05
"""Pause before the first attempt to open again: a cable that was bumped is back within one."""

MAX_DELAY_S = 2.0
"""Longest pause between attempts where nothing shows that the device is back."""

LOOK_S = 0.02
"""How often it is looked whether an absent port is back: some microseconds of work, and no person sees the delay."""

JITTER = 0.2
"""Share by which pauses vary, so that links that were lost together do not return in step."""

LINES_HELD = 8
"""What was logged last of one link and is not logged again: it goes back and forth between two or three reasons."""

_log = logging.getLogger(__name__)

OnBytes = Callable[[bytes], None]


class Connection(Protocol):
    """One opening of a port or server. What arrives goes to the ``OnBytes`` its opener was given.

    Attributes:
        identity: What was opened: the address, and what else tells devices apart.
        overruns: Pieces that were lost before they could be read, because the daemon was behind.
    """

    @property
    def identity(self) -> str: ...  # noqa: D102

    @property
    def overruns(self) -> int: ...  # noqa: D102

    async def until_lost(self) -> str:
        """Return when the connection has ended, with the reason for people.

        Raises:
            Exception: Whatever the consumer of the bytes raised; nothing is handed on after that.
        """
        ...

    def write(self, data: bytes) -> bool:
        """Send at once or not at all, without blocking.

        Returns:
            Whether the bytes were taken; those of a peer that does not read are not.
        """
        ...

    async def close(self) -> None:
        """Release port or socket, within a bounded time; what was written goes out first where the peer reads."""
        ...


Opener = Callable[[LinkSpec, OnBytes], Awaitable[Connection]]
"""Opens what a LinkSpec names, or raises LinkError saying what was wrong, where, and what would be right."""

Look = Callable[[str], object]
"""What is at an address now: another once another device is there; None while there is none."""


class Link:
    """One link: open it, hand on what arrives, and open it again, for ever.

    Events of one link come in order: LinkUp, its Bytes, LinkDown. A reason why the link is down is told once, and
    again only when another takes its place. Closing by cancellation tells nothing: whoever cancels knows. The log hears
    of the same once until bytes have come: a UDP device that is off opens and is lost for ever. Whatever else than a
    LinkError an attempt to open or close raises is a reason like any other: no device ends the daemon.

    Attributes:
        refused_writes: Writes that were dropped because the link was down or the device did not read.
    """

    def __init__(
        self, spec: LinkSpec, open_connection: Opener, on_event: Callable[[Event], None], look: Look | None = None
    ) -> None:
        self.refused_writes = 0
        self._spec = spec
        self._open = open_connection
        self._look = look
        self._on_event = on_event
        self._connection: Connection | None = None
        self._overruns = 0
        self._told = ""
        self._logged: deque[str] = deque(maxlen=LINES_HELD)
        self._taking, self._heard = True, False
        self._delay_s = FIRST_DELAY_S

    @property
    def overruns(self) -> int:
        """Pieces lost before they could be read, since the start."""
        return self._overruns + (self._connection.overruns if self._connection is not None else 0)

    async def run(self) -> NoReturn:
        """Serve the link until cancelled.

        Raises:
            Exception: Whatever ``on_event`` raised; the link is closed by then.
        """
        while True:
            seen = self._look(self._spec.address) if self._look is not None else None
            try:
                answer = b"" if self._spec.inquiry is None else await inquire(self._spec.address, self._spec.inquiry)
                connection = await self._open(self._spec, self._hand_on)
            except LinkError as error:
                reason = str(error)
            except Exception as error:
                reason = f"{self._spec.address}: cannot be opened ({type(error).__name__}: {error})"
            else:
                reason = await self._serve(connection, answer)
            self._tell_down(reason)
            await self._pause(seen)

    def write(self, data: bytes) -> bool:
        """Send bytes now or never; True when they were taken. A late command is worse than none."""
        if self._connection is None:
            self.refused_writes += 1
            return False
        taken = self._connection.write(data)
        if not taken:
            self.refused_writes += 1
            if self._taking:
                _log.warning("%s (%s) does not read: a command was dropped", self._spec.name, self._spec.address)
        self._taking = taken
        return taken

    async def _pause(self, seen: object) -> None:
        """Wait before the next attempt, no longer than until something new is at the address.

        Args:
            seen: What was there at the last attempt.
        """
        pause_s = self._delay_s * random.uniform(1 - JITTER, 1 + JITTER)  # noqa: S311 - no secret
        self._delay_s = min(2 * self._delay_s, MAX_DELAY_S)
        if self._look is None:
            await asyncio.sleep(pause_s)
            return
        until_s = time.monotonic() + pause_s
        while (left_s := until_s - time.monotonic()) > 0:
            await asyncio.sleep(min(LOOK_S, left_s))
            found = self._look(self._spec.address)
            if found is None:
                seen = None
            elif found != seen:
                self._delay_s = FIRST_DELAY_S
                return

    async def _serve(self, connection: Connection, answer: bytes) -> str:
        self._connection = connection
        self._taking, self._heard = True, False
        opened_s = time.monotonic()
        self._told = ""
        self._tell_log(logging.INFO, f"open ({connection.identity})")
        try:
            self._on_event(LinkUp(self._spec.name, connection.identity))
            if answer:
                self._on_event(Bytes(self._spec.name, answer))
            return await connection.until_lost()
        finally:
            self._connection = None
            self._overruns += connection.overruns
            if self._heard:
                self._logged.clear()
                # a device that opens, says something and dies at once keeps its growing pause
                if time.monotonic() - opened_s >= STEADY_S:
                    self._delay_s = FIRST_DELAY_S
            await self._close(connection)

    async def _close(self, connection: Connection) -> None:
        try:
            await connection.close()
        except Exception as error:
            _log.warning("%s: did not close well: %s: %s", self._spec.name, type(error).__name__, error)

    def _hand_on(self, data: bytes) -> None:
        self._heard = True
        self._on_event(Bytes(self._spec.name, data))

    def _tell_down(self, reason: str) -> None:
        if reason != self._told:
            self._told = reason
            self._tell_log(logging.WARNING, reason)
            self._on_event(LinkDown(self._spec.name, reason))

    def _tell_log(self, level: int, line: str) -> None:
        if line not in self._logged:
            self._logged.append(line)
            _log.log(level, "%s: %s", self._spec.name, line)
