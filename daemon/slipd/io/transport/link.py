"""Keep one link open for ever, over any transport, and ask first for what its stream does not contain.

A transport only opens a connection, moves bytes and states why it ended. When to try again, and what to report, is
decided here.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import random
import time
from collections import deque
from collections.abc import Awaitable, Callable
from typing import NoReturn

from slipd.devices import Inquiry
from slipd.errors import LinkError
from slipd.events import Bytes, Event, HostNotice, LinkDown, LinkSpec, LinkUp
from slipd.io.transport.link_connection import Connection, OnBytes, host_and_port

STEADY_S = 0.5
"""Time with bytes after which a connection counts as good, s: the next pause is then FIRST_DELAY_S again."""

FIRST_DELAY_S = 0.05
"""Pause before the first attempt to open again, s: a loose contact in a cable is back within it."""

MAX_DELAY_S = 2.0
"""Longest pause between attempts while nothing shows that the device is back, s."""

PROBE_S = 0.02
"""Period of the checks whether an absent port is back, s: each costs some microseconds."""

JITTER = 0.2
"""Relative random variation of the pauses, so that links that were lost together do not return in step."""

LINES_HELD = 8
"""Most recent log lines of a link that are not repeated: a failing link alternates between two or three reasons."""

INQUIRY_TIMEOUT_S = 2.0
"""Longest duration of request and answer, s: a working device takes some milliseconds."""

MAX_REPLY_BYTES = 65_536
"""Longest answer of unknown length: several times the settings page of a sensor."""

_log = logging.getLogger(__name__)

Opener = Callable[[LinkSpec, OnBytes], Awaitable[Connection]]
"""Opens a link by its LinkSpec, or raises LinkError."""

Probe = Callable[[str], object]
"""Returns a token of the device at an address: a different one for a different device, None if there is none."""


class Link:
    """One link: open it, deliver its bytes, and open it again, for ever.

    Events of one link come in order: LinkUp, its Bytes, LinkDown. A reason why the link is down is reported once, and
    again only after a different one. Cancellation reports nothing. The log has each line once until bytes arrive,
    because a UDP device that is off opens and is lost again and again. Any exception while opening or closing is a
    reason like any other: no device ends the daemon.

    Args:
        spec: The link.
        open_connection: Opens a connection.
        on_event: Called with each event.
        probe: Reports which device is at the address, so that a device that is back is opened at once; None: only the
            pause decides.

    Attributes:
        refused_writes: Writes dropped because the link was down or the device did not read.
    """

    def __init__(
        self, spec: LinkSpec, open_connection: Opener, on_event: Callable[[Event], None], probe: Probe | None = None
    ) -> None:
        self.refused_writes = 0
        self._spec = spec
        self._open = open_connection
        self._probe = probe
        self._on_event = on_event
        self._connection: Connection | None = None
        self._overruns = 0
        self._reported = ""
        self._latency = ""
        self._logged: deque[str] = deque(maxlen=LINES_HELD)
        self._delay_s = FIRST_DELAY_S
        self._pieces = 0  # delivered by the newest connection
        self._looked: tuple[int, bool] = 0, False

    @property
    def overruns(self) -> int:
        """Pieces lost before they could be read, since the start."""
        return self._overruns + (self._connection.overruns if self._connection is not None else 0)

    def unread(self) -> bool:
        """Return whether bytes wait, as at the last call, and none were delivered since."""
        before = self._looked
        self._looked = self._pieces, self._connection is not None and self._connection.unread()
        return self._looked[1] and self._looked == before

    async def run(self) -> NoReturn:
        """Keep the link open until cancelled.

        Raises:
            Exception: The exception of ``on_event``; the link is closed by then.
        """
        while True:
            seen = self._probe(self._spec.address) if self._probe is not None else None
            try:
                answer = b"" if self._spec.inquiry is None else await inquire(self._spec.address, self._spec.inquiry)
                connection = await self._open(self._spec, self._deliver)
            except LinkError as error:
                reason = str(error)
            except Exception as error:
                reason = f"{self._spec.address}: cannot be opened ({type(error).__name__}: {error})"
            else:
                reason = await self._serve(connection, answer)
            self._report_down(reason)
            await self._pause(seen)

    def write(self, data: bytes) -> bool:
        """Send bytes at once or not at all, as a late command is worse than none; return whether they were sent."""
        sent = self._connection is not None and self._connection.write(data)
        self.refused_writes += not sent
        return sent

    async def _pause(self, seen: object) -> None:
        """Wait before the next attempt, but not longer than until a new device is at the address.

        Args:
            seen: Token of the device at the last attempt.
        """
        pause_s = self._delay_s * random.uniform(1 - JITTER, 1 + JITTER)  # noqa: S311 - not a secret
        self._delay_s = min(2 * self._delay_s, MAX_DELAY_S)
        if self._probe is None:
            await asyncio.sleep(pause_s)
            return
        until_s = time.monotonic() + pause_s
        while (left_s := until_s - time.monotonic()) > 0:
            await asyncio.sleep(min(PROBE_S, left_s))
            found = self._probe(self._spec.address)
            if found is None:
                seen = None
            elif found != seen:
                self._delay_s = FIRST_DELAY_S
                return

    async def _serve(self, connection: Connection, answer: bytes) -> str:
        self._connection = connection
        self._pieces = 0
        opened_s = time.monotonic()
        self._reported = ""
        self._log_once(logging.INFO, f"open ({connection.identity})")
        try:
            self._on_event(LinkUp(self._spec.name, connection.identity))
            if connection.latency != self._latency:
                self._latency = connection.latency
                if self._latency:
                    self._log_once(logging.WARNING, self._latency)
                self._on_event(HostNotice(f"latency {self._spec.name}", self._latency))
            if answer:
                self._on_event(Bytes(self._spec.name, answer))
            return await connection.until_lost()
        finally:
            self._connection = None
            self._overruns += connection.overruns
            if self._pieces:
                self._logged.clear()
                # a device that opens, sends something and dies at once keeps its growing pause
                if time.monotonic() - opened_s >= STEADY_S:
                    self._delay_s = FIRST_DELAY_S
            try:
                await connection.close()
            except Exception as error:
                self._log_once(logging.WARNING, f"closing failed: {type(error).__name__}: {error}")

    def _deliver(self, data: bytes) -> None:
        self._pieces += 1
        self._on_event(Bytes(self._spec.name, data))

    def _report_down(self, reason: str) -> None:
        if reason != self._reported:
            self._reported = reason
            self._log_once(logging.WARNING, reason, slipd_fault="stream-fault" if self._pieces else "stream-missing")
            self._on_event(LinkDown(self._spec.name, reason))

    def _log_once(self, level: int, line: str, **fields: str) -> None:
        if line not in self._logged:
            self._logged.append(line)
            _log.log(level, "%s: %s", self._spec.name, line, extra={"slipd_stream": self._spec.name} | fields)


async def inquire(address: str, inquiry: Inquiry) -> bytes:
    """Ask the host of a link over TCP for what its stream does not contain, such as the calibration of a sensor.

    The request of the inquiry is sent, then the change that the answer calls for. A change that fails is no fault of
    the link: the answer shows it.

    Returns:
        The newest whole answer.

    Raises:
        LinkError: No answer within INQUIRY_TIMEOUT_S, an answer that is cut off or too long, or one that fails its
            check.
    """
    answer = await _checked(address, inquiry)
    if request := inquiry.change(answer):
        with contextlib.suppress(LinkError):
            await _checked(address, Inquiry(inquiry.port, request, 0))
        with contextlib.suppress(LinkError):
            answer = await _checked(address, inquiry)
    return answer


async def _checked(address: str, inquiry: Inquiry) -> bytes:
    host, _ = host_and_port(address)
    try:
        async with asyncio.timeout(INQUIRY_TIMEOUT_S):
            answer = await _ask(host, inquiry)
        fault = inquiry.check(answer)
    except TimeoutError:
        fault = f"no answer within {INQUIRY_TIMEOUT_S:g} s"
    except asyncio.IncompleteReadError as error:
        fault = f"the answer must have {inquiry.reply_bytes} bytes, got {len(error.partial)}"
    except (OSError, ValueError) as error:
        fault = str(error)
    if not fault:
        return answer
    raise LinkError(
        f"{address}: inquiry on TCP port {inquiry.port} failed: {fault}; switch the device on, correct the address, or"
        " state in the options what the device would answer"
    )


async def _ask(host: str, inquiry: Inquiry) -> bytes:
    reader, writer = await asyncio.open_connection(host, inquiry.port, limit=MAX_REPLY_BYTES)
    try:
        writer.write(inquiry.request)
        if inquiry.reply_bytes:
            return await reader.readexactly(inquiry.reply_bytes)
        answer = b""
        while chunk := await reader.read(MAX_REPLY_BYTES):
            answer += chunk
            if len(answer) > MAX_REPLY_BYTES:
                raise ValueError(f"the answer has more than {MAX_REPLY_BYTES} bytes")
        if not answer:
            raise ValueError("the device closed the connection without an answer")
        return answer
    finally:
        writer.transport.abort()  # nothing is left to send
