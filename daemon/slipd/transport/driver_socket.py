"""A local socket at which one driver of another process is served: a raw stream, as of a serial line.

The link is open while a driver is connected. Whoever comes meanwhile is told so and turned away.
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
from slipd.transport.link import OnBytes
from slipd.transport.tcp import TcpConnection
from slipd.zmtp.endpoint import check_directory

MAX_PATH_BYTES = 107
"""Longest path of a Unix socket (``sun_path`` less its closing zero)."""

WAITING = 8
"""Connections that the kernel keeps until they are looked at."""

BUSY = "another driver is connected"


async def open_driver_socket(spec: LinkSpec, on_bytes: OnBytes) -> DriverConnection:
    """Bind the socket, for this process's user alone, and wait for a driver.

    Raises:
        LinkError: The address is none, others could put a socket of theirs there, another program serves there, or it
            cannot be bound.
    """
    path = spec.address.removeprefix("unix://")
    server = _bind(spec.address, path)
    try:
        driver, _ = await asyncio.get_running_loop().sock_accept(server)
    except OSError as error:
        _close(server, path)
        raise LinkError(f"{spec.address}: no driver can be served: {error}") from error
    except BaseException:  # given up meanwhile
        _close(server, path)
        raise
    driver.setblocking(False)
    return DriverConnection(spec.address, driver, on_bytes, server)


class DriverConnection(TcpConnection):
    """A connected driver; see `slipd.transport.link.Connection` for what each method promises."""

    def __init__(self, address: str, driver: socket.socket, on_bytes: OnBytes, server: socket.socket) -> None:
        super().__init__(address, driver, on_bytes)
        self._server = server
        self._loop.add_reader(server, self._turn_away)

    async def close(self) -> None:
        """Close the socket, so that no driver connects to nobody, and then as a device's."""
        self._loop.remove_reader(self._server)
        _close(self._server, self.identity.removeprefix("unix://"))
        await super().close()

    def _turn_away(self) -> None:
        with contextlib.suppress(OSError):  # it left, or no descriptor is free for it
            visitor, _ = self._server.accept()
            with visitor:
                visitor.setblocking(False)
                visitor.send(encode_notice(REFUSED, BUSY))


def _bind(address: str, path: str) -> socket.socket:
    size = len(os.fsencode(path))
    if not path.startswith("/") or size > MAX_PATH_BYTES:
        raise LinkError(
            f"{address}: no local socket; one is unix:///run/slipd/gripper, with at most {MAX_PATH_BYTES} bytes of path"
        )
    if not Path(path).parent.is_dir():
        raise LinkError(f"{address}: there is no directory {Path(path).parent}; make it, or name one that exists")
    check_directory(address, Path(path).parent)
    server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    umask = os.umask(0o177)
    try:
        _clear(path)
        server.bind(path)
        server.listen(WAITING)
        server.setblocking(False)
    except OSError as error:
        server.close()
        raise LinkError(f"{address}: cannot be bound: {error}; name another path, or free this one") from error
    finally:
        os.umask(umask)
    return server


def _clear(path: str) -> None:
    """Remove the socket that a dead process left.

    Raises:
        OSError: Something else lies there, or somebody serves.
    """
    if not os.path.lexists(path):
        return
    if not stat.S_ISSOCK(os.lstat(path).st_mode):
        raise FileExistsError("this file is no socket")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as visitor:
        visitor.setblocking(False)
        try:
            visitor.connect(path)
        except ConnectionRefusedError:
            Path(path).unlink()
            return
        except BlockingIOError:  # its queue of visitors is full
            pass
    raise FileExistsError("another program serves here")


def _close(server: socket.socket, path: str) -> None:
    server.close()
    Path(path).unlink(missing_ok=True)
