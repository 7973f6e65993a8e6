"""A device with a TCP port as a connection: a raw stream of bytes, as on a serial line."""

from __future__ import annotations

import asyncio
import socket

from slipd.events import LinkSpec
from slipd.io.transport.address import connected
from slipd.io.transport.byte_delivery import READ_BYTES, ByteDelivery, is_readable
from slipd.io.transport.link import OnBytes
from slipd.io.transport.nonblocking_writer import NonblockingWriter
from slipd.io.zmtp.endpoint import set_tcp_options

DRAIN_TIMEOUT_S = 0.2
"""Longest wait for the rest of a partial write when closing, s."""

DRAIN_POLL_S = 0.005


async def open_tcp(spec: LinkSpec, on_bytes: OnBytes) -> TcpConnection:
    """Connect to a device.

    Raises:
        LinkError: The address is invalid, or nothing answers there.
    """
    opened = await connected(spec.address, socket.SOCK_STREAM)
    set_tcp_options(opened)
    return TcpConnection(spec.address, opened, on_bytes)


class TcpConnection:
    """An open connection; see `slipd.io.transport.link.Connection` for the contract of each method."""

    overruns = 0
    latency = ""

    def __init__(self, address: str, opened: socket.socket, on_bytes: OnBytes) -> None:
        self.identity = address
        self._loop = asyncio.get_running_loop()
        self._socket = opened
        self._delivery = ByteDelivery(on_bytes)
        self._writer = NonblockingWriter(opened.fileno(), self._lose)
        self._loop.add_reader(opened, self._read)

    async def until_lost(self) -> str:
        """Wait for the end of the connection and return the reason, or raise the exception of the consumer."""
        return await self._delivery.until_lost()

    def write(self, data: bytes) -> bool:
        """Send at once or not at all; return False while the device does not read."""
        return not self._delivery.ended and self._writer.write(data)

    def unread(self) -> bool:
        """Return whether bytes wait to be read."""
        return not self._delivery.ended and is_readable(self._socket.fileno())

    async def close(self) -> None:
        """Wait at most DRAIN_TIMEOUT_S for the rest of a partial write, then close; the kernel sends what it has."""
        self._loop.remove_reader(self._socket)
        deadline_s = self._loop.time() + DRAIN_TIMEOUT_S
        try:
            while self._writer.under_way and not self._delivery.ended and self._loop.time() < deadline_s:  # noqa: ASYNC110 - there is no event
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
            self._lose(ConnectionError("the other side closed it"))
        elif not self._delivery.deliver(data):
            self._loop.remove_reader(self._socket)

    def _lose(self, error: OSError) -> None:
        self._loop.remove_reader(self._socket)
        self._writer.stop()
        self._delivery.lose(f"{self.identity}: connection ended ({error}); it is opened again when the device is back")
