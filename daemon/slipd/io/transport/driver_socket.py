"""A local socket for one driver in another process: a raw stream of bytes, as on a serial line.

The link is open while a driver is connected. A second driver gets a notice and is disconnected.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import stat
from pathlib import Path

from slipd.devices.external_gripper.external_gripper_message import REFUSED, encode_notice
from slipd.errors import LinkError
from slipd.events import LinkSpec
from slipd.io.transport.link import OnBytes
from slipd.io.transport.tcp import TcpConnection
from slipd.io.zmtp.endpoint import MAX_IPC_PATH_BYTES, check_directory

WAITING = 8
"""Connections that the kernel queues until they are accepted."""

BUSY = "another driver is connected"


async def open_driver_socket(spec: LinkSpec, on_bytes: OnBytes) -> DriverConnection:
    """Bind the socket for this user only, and wait for a driver.

    Raises:
        LinkError: The address is invalid, other users could replace the socket, another program serves it, or it cannot
            be bound.
    """
    path = spec.address.removeprefix("unix://")
    server = _bind(spec.address, path)
    try:
        driver, _ = await asyncio.get_running_loop().sock_accept(server)
    except OSError as error:
        _close(server, path)
        raise LinkError(f"{spec.address}: cannot accept a driver: {error}") from error
    except BaseException:  # cancelled
        _close(server, path)
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
        _close(self._server, self.identity.removeprefix("unix://"))
        await super().close()

    def _refuse_driver(self) -> None:
        with contextlib.suppress(OSError):  # it has left, or no file descriptor is free
            visitor, _ = self._server.accept()
            with visitor:
                visitor.setblocking(False)
                visitor.send(encode_notice(REFUSED, BUSY))


def _bind(address: str, path: str) -> socket.socket:
    size = len(os.fsencode(path))
    if not path.startswith("/") or size > MAX_IPC_PATH_BYTES:
        raise LinkError(
            f"{address}: must be an absolute path of at most {MAX_IPC_PATH_BYTES} bytes, such as unix:///run/slipd/gripper"
        )
    if not Path(path).parent.is_dir():
        raise LinkError(f"{address}: there is no directory {Path(path).parent}; create it, or name another")
    check_directory(address, Path(path).parent)
    server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    umask = os.umask(0o177)
    try:
        _remove_stale(path)
        server.bind(path)
        server.listen(WAITING)
        server.setblocking(False)
    except OSError as error:
        server.close()
        raise LinkError(f"{address}: cannot be bound: {error}; name another path, or free this one") from error
    finally:
        os.umask(umask)
    return server


def _remove_stale(path: str) -> None:
    """Remove the socket of a dead process.

    Raises:
        OSError: The file is not a socket, or a program serves it.
    """
    if not os.path.lexists(path):
        return
    if not stat.S_ISSOCK(os.lstat(path).st_mode):
        raise FileExistsError("this file is not a socket")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as visitor:
        visitor.setblocking(False)
        try:
            visitor.connect(path)
        except ConnectionRefusedError:
            Path(path).unlink()
            return
        except BlockingIOError:  # its backlog is full
            pass
    raise FileExistsError("another program serves this socket")


def _close(server: socket.socket, path: str) -> None:
    server.close()
    Path(path).unlink(missing_ok=True)
