"""An open connection: its bytes go to a consumer until it ends, and what is written is sent at once or not at all."""

from __future__ import annotations

import asyncio
import os
import select
import socket
from collections.abc import Callable
from io import RawIOBase
from urllib.parse import urlsplit

from slipd.config.stream_checks import address_fault
from slipd.errors import LinkError
from slipd.io.zmtp.endpoint import is_ready

READ_BYTES = 1024
"""Bytes delivered before other tasks of the loop run: about 30 readings of a force sensor, or 1 to 2 ms of
processing."""

DRAIN_TIMEOUT_S = 0.2
"""Longest wait for unsent bytes when closing, s: enough for 2 kB at 115200 baud."""

DRAIN_POLL_S = 0.005
"""Period of the checks for unsent bytes when closing, s: the kernel reports their number, but sends no event."""

OnBytes = Callable[[bytes], None]


class Connection:
    """Base of the connections of all transports; it delivers the received bytes.

    Args:
        identity: What was opened: the address, and whatever else distinguishes the device.
        on_bytes: The consumer of received bytes.

    Attributes:
        identity: As above.
        latency: What delays the bytes and cannot be changed from here, for people; "" for nothing.
    """

    latency = ""

    def __init__(self, identity: str, on_bytes: OnBytes) -> None:
        self.identity = identity
        self._on_bytes = on_bytes
        self._loop = asyncio.get_running_loop()
        self._lost: asyncio.Future[str] = self._loop.create_future()

    @property
    def overruns(self) -> int:
        """Pieces that were lost before they could be read, because the daemon was late."""
        return 0

    async def until_lost(self) -> str:
        """Wait for the end of the connection and return the reason, for people.

        Raises:
            Exception: The exception of the consumer; no bytes are delivered after it.
        """
        return await asyncio.shield(self._lost)  # cancelling the caller must not cancel the future

    def write(self, data: bytes) -> bool:
        """Send at once or not at all, without blocking; return whether the bytes were sent. By default none are."""
        del data
        return False

    def unread(self) -> bool:
        """Return whether bytes wait to be read."""
        return False

    async def close(self) -> None:
        """Release the port or socket within a bounded time; written bytes are sent first if the peer reads."""
        raise NotImplementedError

    @property
    def ended(self) -> bool:
        """Whether the connection has ended."""
        return self._lost.done()

    def deliver(self, data: bytes) -> None:
        """Pass bytes to the consumer, unless the connection has ended; it ends if the consumer fails.

        `until_lost` raises the exception of the consumer: asyncio would only log it if the reader's callback raised it.
        """
        if not self._lost.done():
            try:
                self._on_bytes(data)
            except Exception as error:
                self._lost.set_exception(error)
                self._stop()

    def lose(self, reason: str) -> None:
        """End the connection with a reason for people; only the first call counts."""
        if not self.ended:
            self._lost.set_result(reason)
            self._stop()

    def _stop(self) -> None:
        """Stop reading and writing."""


class FileConnection(Connection):
    """A stream of bytes over a port or socket, which this object owns and which does not block.

    Args:
        address: Address of the link, for people.
        opened: The port or socket.
        on_bytes: The consumer.
    """

    def __init__(self, address: str, opened: socket.socket | RawIOBase, on_bytes: OnBytes) -> None:
        super().__init__(address, on_bytes)
        self._address, self._opened, self._fd = address, opened, opened.fileno()
        self._rest = b""  # of a partial write
        self._start_reading()

    def write(self, data: bytes) -> bool:
        """Send at once or not at all, but complete a partial write; return False while the device does not read."""
        if self._rest or self.ended:
            return False
        sent = self._send(data)
        if 0 < sent < len(data):
            self._rest = data[sent:]
            self._loop.add_writer(self._fd, self._send_rest)
        return sent > 0 or not data

    def unread(self) -> bool:
        """Return whether bytes wait to be read."""
        return not self.ended and is_ready(self._fd, select.POLLIN)

    async def close(self) -> None:
        """Wait at most DRAIN_TIMEOUT_S for unsent bytes, then release the port or socket."""
        self._stop_reading()
        until_s = self._loop.time() + DRAIN_TIMEOUT_S
        try:
            while not self.ended and self._unsent() and self._loop.time() < until_s:  # noqa: ASYNC110 - there is no event
                await asyncio.sleep(DRAIN_POLL_S)
        finally:
            self._stop()
            self._release()

    def _start_reading(self) -> None:
        self._loop.add_reader(self._fd, self._read)

    def _stop_reading(self) -> None:
        self._loop.remove_reader(self._fd)

    def _unsent(self) -> bool:
        return bool(self._rest)

    def _release(self) -> None:
        self._opened.close()

    def _read(self) -> None:
        data = self._receive(READ_BYTES)
        if data:
            self.deliver(data)
        elif data is not None:
            self._fail("the other side closed it")

    def _receive(self, size: int) -> bytes | None:
        """Return what has arrived; None if nothing has, or the connection ended."""
        try:
            return os.read(self._fd, size)
        except BlockingIOError:
            pass
        except OSError as error:
            self._fail(error)
        return None

    def _send(self, data: bytes) -> int:
        """Return how many bytes the kernel accepted."""
        try:
            return os.write(self._fd, data)
        except BlockingIOError:
            pass
        except OSError as error:
            self._fail(error)
        return 0

    def _send_rest(self) -> None:
        sent = self._send(self._rest)
        self._rest = self._rest[sent:]
        if not self._rest:
            self._loop.remove_writer(self._fd)

    def _fail(self, error: object) -> None:
        self.lose(f"{self._address}: connection ended ({error}); it is opened again when the device is back")

    def _stop(self) -> None:
        """Stop before the descriptor is closed, because its number may be reused."""
        self._stop_reading()
        self._loop.remove_writer(self._fd)
        self._rest = b""


def host_and_port(address: str) -> tuple[str, int]:
    """Return host and port of an address such as ``udp://HOST:PORT``; an IPv6 address as host is in brackets.

    Raises:
        LinkError: The address has no host, or no possible port.
    """
    if fault := address_fault(address):
        scheme = address.partition("://")[0]
        raise LinkError(f"{address}: {fault}; a valid one is {scheme}://192.168.1.1:49152")
    parts = urlsplit(address)
    return parts.hostname or "", parts.port or 0
