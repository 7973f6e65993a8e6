"""A local socket for one driver in another process: a raw stream of bytes, as on a serial line.

The link is open while a driver is connected. A second driver gets a notice and is disconnected.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket

from slipd.devices.external_gripper.external_gripper_message import REFUSED, encode_notice
from slipd.errors import LinkError
from slipd.events import LinkSpec
from slipd.io.transport.link import OnBytes
from slipd.io.transport.tcp import TcpConnection
from slipd.io.zmtp.endpoint import bind, release

BUSY = "another driver is connected"


async def open_driver_socket(spec: LinkSpec, on_bytes: OnBytes) -> DriverConnection:
    """Bind the socket for this user only, and wait for a driver.

    Raises:
        LinkError: The address is invalid, other users could replace the socket, another program serves it, or it cannot
            be bound.
    """
    server, _ = bind(spec.address)
    try:
        driver, _ = await asyncio.get_running_loop().sock_accept(server)
    except OSError as error:
        release(server, spec.address)
        raise LinkError(f"{spec.address}: cannot accept a driver: {error}") from error
    except BaseException:  # cancelled
        release(server, spec.address)
        raise
    driver.setblocking(False)
    return DriverConnection(spec.address, driver, on_bytes, server)


class DriverConnection(TcpConnection):
    """A connected driver; see `slipd.io.transport.link.Connection` for the contract of each method."""

    def __init__(self, address: str, driver: socket.socket, on_bytes: OnBytes, server: socket.socket) -> None:
        super().__init__(address, driver, on_bytes)
        self._server = server
        self._loop.add_reader(server, self._refuse_driver)

    async def close(self) -> None:
        """Close the listening socket, so that no other driver connects, and then the connection."""
        self._loop.remove_reader(self._server)
        release(self._server, self.identity)
        await super().close()

    def _refuse_driver(self) -> None:
        with contextlib.suppress(OSError):  # it has left, or no file descriptor is free
            visitor, _ = self._server.accept()
            with visitor:
                visitor.setblocking(False)
                visitor.send(encode_notice(REFUSED, BUSY))
