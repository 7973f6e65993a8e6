"""A device behind a TCP port as a connection: a raw stream, as of a serial line."""

from __future__ import annotations

import asyncio
import socket

from slipd.events import LinkSpec
from slipd.transport.address import connected
from slipd.transport.byte_delivery import READ_BYTES, ByteDelivery
from slipd.transport.link import OnBytes
from slipd.transport.nonblocking_writer import NonblockingWriter

KEEPALIVE_S = 1
"""A silent device is asked for a sign of life so often."""

KEEPALIVE_PROBES = 2
"""Unanswered in a row they end the connection: a cut cable is noticed within 3 s."""

UNACKNOWLEDGED_MS = 3000
"""What was written and is not acknowledged for so long ends it too; the kernel alone would try for a quarter hour."""

DRAIN_TIMEOUT_S = 0.2
"""How long closing waits for the rest of a write to be taken."""

DRAIN_POLL_S = 0.005


async def open_tcp(spec: LinkSpec, on_bytes: OnBytes) -> TcpConnection:
    """Connect to a device.

    Raises:
        LinkError: The address is none, or nothing there answers.
    """
    opened = await connected(spec.address, socket.SOCK_STREAM)
    for level, option, value in (
        (socket.IPPROTO_TCP, socket.TCP_NODELAY, 1),
        (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
        (socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, KEEPALIVE_S),
        (socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, KEEPALIVE_S),
        (socket.IPPROTO_TCP, socket.TCP_KEEPCNT, KEEPALIVE_PROBES),
        (socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNACKNOWLEDGED_MS),
    ):
        opened.setsockopt(level, option, value)
    return TcpConnection(spec.address, opened, on_bytes)


class TcpConnection:
    """An open connection; see `slipd.transport.link.Connection` for what each method promises."""

    overruns = 0

    def __init__(self, address: str, opened: socket.socket, on_bytes: OnBytes) -> None:
        self.identity = address
        self._loop = asyncio.get_running_loop()
        self._socket = opened
        self._delivery = ByteDelivery(on_bytes)
        self._writer = NonblockingWriter(opened.fileno(), self._lose)
        self._loop.add_reader(opened, self._read)

    async def until_lost(self) -> str:
        """Return why the connection ended, or raise what the consumer of its bytes raised."""
        return await self._delivery.until_lost()

    def write(self, data: bytes) -> bool:
        """Send now or never; False while the device does not read."""
        return not self._delivery.ended and self._writer.write(data)

    async def close(self) -> None:
        """Let the rest of a write go for at most DRAIN_TIMEOUT_S, then close; the kernel sends what it has taken."""
        self._loop.remove_reader(self._socket)
        deadline_s = self._loop.time() + DRAIN_TIMEOUT_S
        try:
            while self._writer.under_way and not self._delivery.ended and self._loop.time() < deadline_s:  # noqa: ASYNC110 - nothing tells
                await asyncio.sleep(DRAIN_POLL_S)
        finally:
            self._writer.stop()
            self._socket.close()

    def _read(self) -> None:
        try:
            data = self._socket.recv(READ_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            self._lose(error)
            return
        if not data:
            self._lose(ConnectionError("it closed the connection"))
        elif not self._delivery.deliver(data):
            self._loop.remove_reader(self._socket)

    def _lose(self, error: OSError) -> None:
        self._loop.remove_reader(self._socket)
        self._writer.stop()
        self._delivery.lose(f"{self.identity}: connection ended ({error}); it is opened again when the device is back")
