"""A device that sends datagrams as a connection: each is handed on as one piece of bytes, as far as devices fill it.

The socket is connected: datagrams of others never reach it, and the host of a device that does not listen says so.
"""

from __future__ import annotations

import array
import asyncio
import socket

from slipd.events import LinkSpec
from slipd.transport.address import connected
from slipd.transport.byte_delivery import READ_BYTES, ByteDelivery
from slipd.transport.link import OnBytes

RECEIVE_BUFFER_BYTES = 512 * 1024
"""Asked of the kernel, which counts some 1 kB for each small datagram: it bears a stall of 100 ms at 4 kHz."""

DATAGRAMS_PER_WAKE = 32
"""Most datagrams read before the rest of the loop has its turn, were they empty; READ_BYTES bounds them otherwise."""

MAX_DATAGRAM_BYTES = 2048
"""Most bytes taken of a datagram; the rest of a longer one is dropped. Devices send 1440 at the most, 40 records."""

SO_MEMINFO, MEMINFO_WORDS, MEMINFO_DROPS = 55, 9, 8
"""Linux <asm-generic/socket.h> and <linux/sock_diag.h>: what the kernel counts of a socket; it has the drops last."""


async def open_udp(spec: LinkSpec, on_bytes: OnBytes) -> UdpConnection:
    """Open a socket to the device; that it is there shows when it sends.

    Raises:
        LinkError: The address is none, or no way leads there.
    """
    return UdpConnection(spec.address, await connected(spec.address, socket.SOCK_DGRAM), on_bytes)


class UdpConnection:
    """An open socket; see `slipd.transport.link.Connection` for what each method promises."""

    def __init__(self, address: str, opened: socket.socket, on_bytes: OnBytes) -> None:
        self.identity = address
        self._loop = asyncio.get_running_loop()
        self._socket = opened
        self._delivery = ByteDelivery(on_bytes)
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        self._loop.add_reader(opened, self._read)

    @property
    def overruns(self) -> int:
        """Datagrams that the kernel dropped because the daemon was behind, or because they were damaged."""
        try:
            told = self._socket.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, 4 * MEMINFO_WORDS)
        except OSError:  # a kernel that does not tell
            return 0
        return array.array("I", told)[MEMINFO_DROPS] if len(told) == 4 * MEMINFO_WORDS else 0

    async def until_lost(self) -> str:
        """Return why the device takes no datagrams, or raise what the consumer of its own raised."""
        return await self._delivery.until_lost()

    def write(self, data: bytes) -> bool:
        """Send as one datagram, now or never."""
        if self._delivery.ended:
            return False
        try:
            return self._socket.send(data) == len(data)
        except BlockingIOError:
            return False
        except OSError as error:
            self._lose(error)
            return False

    async def close(self) -> None:
        """Close the socket at once."""
        self._loop.remove_reader(self._socket)
        self._socket.close()

    def _read(self) -> None:
        taken = 0
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
            taken += len(data)
            if taken >= READ_BYTES:
                return

    def _lose(self, error: OSError) -> None:
        self._loop.remove_reader(self._socket)
        what = "the host says that nobody listens there" if isinstance(error, ConnectionRefusedError) else str(error)
        self._delivery.lose(f"{self.identity}: {what}; switch the device on, or correct the address")
