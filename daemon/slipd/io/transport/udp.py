"""A device that sends datagrams as a connection: each datagram is delivered as one piece of bytes.

The socket is connected, so datagrams of other senders never reach it, and the host of a device that does not listen
reports so.
"""

from __future__ import annotations

import array
import asyncio
import socket

from slipd.events import LinkSpec
from slipd.io.transport.address import connected
from slipd.io.transport.byte_delivery import READ_BYTES, ByteDelivery, is_readable
from slipd.io.transport.link import OnBytes

RECEIVE_BUFFER_BYTES = 512 * 1024
"""Requested receive buffer: the kernel counts about 1 kB for each small datagram, so it holds 100 ms at 4 kHz."""

DATAGRAMS_PER_WAKE = 32
"""Most datagrams read before other tasks of the loop run, even if they are empty; READ_BYTES is a limit too."""

MAX_DATAGRAM_BYTES = 2048
"""Most bytes read of a datagram; the rest is dropped. Devices send at most 1440 bytes, which are 40 records."""

SO_MEMINFO, MEMINFO_WORDS, MEMINFO_DROPS = 55, 9, 8
"""Linux <asm-generic/socket.h> and <linux/sock_diag.h>: counters of a socket, of which the last is the drops."""


async def open_udp(spec: LinkSpec, on_bytes: OnBytes) -> UdpConnection:
    """Open a socket to the device; only its datagrams show that it is there.

    Raises:
        LinkError: The address is invalid, or there is no route to it.
    """
    return UdpConnection(spec.address, await connected(spec.address, socket.SOCK_DGRAM), on_bytes)


class UdpConnection:
    """An open socket; see `slipd.io.transport.link.Connection` for the contract of each method."""

    latency = ""

    def __init__(self, address: str, opened: socket.socket, on_bytes: OnBytes) -> None:
        self.identity = address
        self._loop = asyncio.get_running_loop()
        self._socket = opened
        self._delivery = ByteDelivery(on_bytes)
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        self._loop.add_reader(opened, self._read)

    @property
    def overruns(self) -> int:
        """Datagrams that the kernel dropped because the daemon was late or they were damaged."""
        try:
            counters = self._socket.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, 4 * MEMINFO_WORDS)
        except OSError:  # a kernel without these counters
            return 0
        return array.array("I", counters)[MEMINFO_DROPS] if len(counters) == 4 * MEMINFO_WORDS else 0

    async def until_lost(self) -> str:
        """Wait for the end of the connection and return the reason, or raise the exception of the consumer."""
        return await self._delivery.until_lost()

    def write(self, data: bytes) -> bool:
        """Send one datagram at once or not at all."""
        if self._delivery.ended:
            return False
        try:
            return self._socket.send(data) == len(data)
        except BlockingIOError:
            return False
        except OSError as error:
            self._lose(error)
            return False

    def unread(self) -> bool:
        """Return whether bytes wait to be read."""
        return not self._delivery.ended and is_readable(self._socket.fileno())

    async def close(self) -> None:
        """Close the socket at once."""
        self._loop.remove_reader(self._socket)
        self._socket.close()

    def _read(self) -> None:
        read_bytes = 0
        for _ in range(DATAGRAMS_PER_WAKE):
            try:
                data = self._socket.recv(MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                return
            except OSError as error:
                self._lose(error)
                return
            if not self._delivery.deliver(data):
                self._loop.remove_reader(self._socket)
                return
            read_bytes += len(data)
            if read_bytes >= READ_BYTES:
                return

    def _lose(self, error: OSError) -> None:
        self._loop.remove_reader(self._socket)
        what = "nothing listens on this port" if isinstance(error, ConnectionRefusedError) else str(error)
        self._delivery.lose(f"{self.identity}: {what}; switch the device on, or correct the address")
