"""Sockets: devices on the network over TCP and UDP, and other programs of this user, which connect to a socket here.

Programs push readings over ZeroMQ; one at a time drives a gripper over a raw stream.
"""

from __future__ import annotations

import array
import asyncio
import contextlib
import socket

from slipd.devices.external_gripper.external_gripper_message import REFUSED, encode_notice
from slipd.errors import LinkError
from slipd.events import LinkSpec
from slipd.io.transport.link_connection import READ_BYTES, Connection, FileConnection, OnBytes, host_and_port
from slipd.io.zmtp.connection import PeerRules
from slipd.io.zmtp.endpoint import bind, release, set_tcp_options
from slipd.io.zmtp.listener import Listener
from slipd.io.zmtp.peer import Peer

OPEN_TIMEOUT_S = 2.0
"""Longest wait for an answer, s: a device on the local network that takes longer is off or stuck."""

RECEIVE_BUFFER_BYTES = 512 * 1024
"""Requested receive buffer: the kernel counts about 1 kB for each small datagram, so it holds 100 ms at 4 kHz."""

DATAGRAMS_PER_WAKE = 32
"""Most datagrams read before other tasks of the loop run, even if they are empty; READ_BYTES is a limit too."""

MAX_DATAGRAM_BYTES = 2048
"""Most bytes read of a datagram; the rest is dropped. Devices send at most 1440 bytes, which are 40 records."""

SO_MEMINFO, MEMINFO_WORDS, MEMINFO_DROPS = 55, 9, 8
"""Linux <asm-generic/socket.h> and <linux/sock_diag.h>: counters of a socket, of which the last is the drops."""

MAX_MESSAGE_BYTES = 64 * 1024
"""Longest message accepted: five times one image of 1024 three-axis taxels in float32."""

MESSAGES_PER_WAKE = 8
"""Messages delivered before other tasks of the loop run: each is a reading, and so a verdict."""

SHARE = 0.75
"""Largest long-term share of the loop time for one sender: readings are the main work, and only this user can push."""

BUSY = "another driver is connected"

_RULES = PeerRules(
    kind=b"PULL", serves=frozenset({b"PUSH"}), max_bytes=MAX_MESSAGE_BYTES, messages_per_wake=MESSAGES_PER_WAKE
)


async def open_tcp(spec: LinkSpec, on_bytes: OnBytes) -> FileConnection:
    """Connect to a device.

    Raises:
        LinkError: The address is invalid, or nothing answers there.
    """
    opened = await connected(spec.address, socket.SOCK_STREAM)
    set_tcp_options(opened)
    return FileConnection(spec.address, opened, on_bytes)


async def open_udp(spec: LinkSpec, on_bytes: OnBytes) -> UdpConnection:
    """Open a socket to the device; only its datagrams show that it is there.

    The socket is connected, so datagrams of other senders never reach it, and the host of a device that does not listen
    reports so.

    Raises:
        LinkError: The address is invalid, or there is no route to it.
    """
    opened = await connected(spec.address, socket.SOCK_DGRAM)
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
    return UdpConnection(spec.address, opened, on_bytes)


class UdpConnection(FileConnection):
    """A device that sends datagrams: each is delivered as one piece of bytes."""

    _opened: socket.socket

    @property
    def overruns(self) -> int:
        """Datagrams that the kernel dropped because the daemon was late or they were damaged."""
        try:
            counters = self._opened.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, 4 * MEMINFO_WORDS)
        except OSError:  # a kernel without these counters
            return 0
        return array.array("I", counters)[MEMINFO_DROPS] if len(counters) == 4 * MEMINFO_WORDS else 0

    def _read(self) -> None:
        read_bytes = 0
        for _ in range(DATAGRAMS_PER_WAKE):
            data = self._receive(MAX_DATAGRAM_BYTES)
            if data is None:
                return
            self.deliver(data)
            read_bytes += len(data)
            if self.ended or read_bytes >= READ_BYTES:
                return

    def _fail(self, error: object) -> None:
        what = "nothing listens on this port" if isinstance(error, ConnectionRefusedError) else error
        self.lose(f"{self._address}: {what}; switch the device on, or correct the address")


async def connected(address: str, kind: socket.SocketKind) -> socket.socket:
    """Return a non-blocking socket connected to an address; of several IP addresses, the first that accepts.

    Raises:
        LinkError: The address is invalid, or nothing answers there.
    """
    host, port = host_and_port(address)
    try:
        async with asyncio.timeout(OPEN_TIMEOUT_S):
            return await _first(host, port, kind)
    except TimeoutError:
        reason = f"no answer within {OPEN_TIMEOUT_S:g} s"
    except OSError as error:
        reason = f"cannot be reached ({error.strerror or error})"
    raise LinkError(f"{address}: {reason}; switch the device on, or correct the address")


async def _first(host: str, port: int, kind: socket.SocketKind) -> socket.socket:
    loop, failure = asyncio.get_running_loop(), OSError("the host name has no address")
    for family, _, protocol, _, target in await loop.getaddrinfo(host, port, type=kind):
        with contextlib.ExitStack() as on_failure:
            made = on_failure.enter_context(socket.socket(family, kind, protocol))
            made.setblocking(False)
            try:
                await loop.sock_connect(made, target)
            except OSError as error:
                failure = error
                continue
            on_failure.pop_all()
            return made
    raise failure


async def open_push_socket(spec: LinkSpec, on_bytes: OnBytes) -> PushConnection:
    """Bind a ZeroMQ socket for this user only, for labs whose own driver holds the port of a sensor.

    Raises:
        LinkError: Its directory does not exist, another program serves it, or it cannot be bound.
    """
    return PushConnection(spec.address, on_bytes)


class PushConnection(Connection):
    """A socket to which other processes push: each message is delivered as one piece of bytes. It is never lost.

    A sender that has used up its share of the loop is paused on purpose; its bytes do not count as unread.
    """

    def __init__(self, endpoint: str, on_bytes: OnBytes) -> None:
        super().__init__(endpoint, on_bytes)
        self._listener = _Pull(self).__enter__()

    async def close(self) -> None:
        """Close the socket at once; unread messages are lost."""
        self._listener.__exit__()


class _Pull(Listener):
    def __init__(self, connection: PushConnection) -> None:
        super().__init__(connection.identity, _RULES, share=SHARE)
        self._connection = connection

    def on_message(self, peer: Peer, frames: list[bytes]) -> None:
        """Deliver a message, which has one frame; of a longer one, the first two are treated as messages."""
        for frame in frames:
            self._connection.deliver(frame)


async def open_driver_socket(spec: LinkSpec, on_bytes: OnBytes) -> DriverConnection:
    """Bind a socket for this user only, and wait for a driver: a raw stream of bytes, as on a serial line.

    Raises:
        LinkError: The address is invalid, other users could replace the socket, another program serves it, or it cannot
            be bound.
    """
    server, _ = bind(spec.address)
    with contextlib.ExitStack() as on_failure:
        on_failure.callback(release, server, spec.address)
        try:
            driver, _ = await asyncio.get_running_loop().sock_accept(server)
        except OSError as error:
            raise LinkError(f"{spec.address}: cannot accept a driver: {error}") from error
        on_failure.pop_all()
    driver.setblocking(False)
    return DriverConnection(spec.address, driver, on_bytes, server)


class DriverConnection(FileConnection):
    """A connected driver; a second one gets a notice and is disconnected."""

    def __init__(self, address: str, driver: socket.socket, on_bytes: OnBytes, server: socket.socket) -> None:
        super().__init__(address, driver, on_bytes)
        self._server = server
        self._loop.add_reader(server, self._refuse_driver)

    async def close(self) -> None:
        """Close the listening socket, so that no other driver connects, and then the connection."""
        self._loop.remove_reader(self._server)
        release(self._server, self._address)
        await super().close()

    def _refuse_driver(self) -> None:
        with contextlib.suppress(OSError):  # it has left, or no file descriptor is free
            visitor, _ = self._server.accept()
            with visitor:
                visitor.setblocking(False)
                visitor.send(encode_notice(REFUSED, BUSY))
