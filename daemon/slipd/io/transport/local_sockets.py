"""Sockets for other processes of this user: some push readings, and one at a time drives a gripper."""

from __future__ import annotations

import asyncio
import contextlib
import socket

from slipd.devices.external_gripper.external_gripper_message import REFUSED, encode_notice
from slipd.errors import LinkError
from slipd.events import LinkSpec
from slipd.io.transport.link_connection import Connection, FileConnection, OnBytes
from slipd.io.zmtp.connection import PeerRules
from slipd.io.zmtp.endpoint import bind, release
from slipd.io.zmtp.listener import Listener
from slipd.io.zmtp.peer import Peer

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
