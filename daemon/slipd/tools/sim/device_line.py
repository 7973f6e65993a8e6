"""The device side of a real line: a pseudo-terminal, a socket or a server. Bytes that nobody reads are lost."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import tty
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path
from urllib.parse import urlsplit

import zmq
from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.exceptions import ConnectionClosed

READ_BYTES = 65_536
PIECES_PER_LOOK = 64
"""Most pieces read at once from a host that floods the line."""

SEND_AHEAD = 64
"""Messages queued for a daemon that does not read."""


class Line(ABC):
    """The device side of a line; see `open_line` for the kinds."""

    dropped = 0
    """Bytes that are known to be lost because the host did not read."""

    _opened = False
    _received: Sequence[bytes] = ()

    def listen(self) -> tuple[bool, list[bytes]]:
        """Return whether the line has been opened since the last call, and the pieces written to it since."""
        opened, received = self._opened, list(self._received)
        self._opened, self._received = False, ()
        return opened, received

    @abstractmethod
    def send(self, pieces: Sequence[bytes]) -> None:
        """Send pieces (frames, messages or datagrams) without waiting; without a listener they are lost."""

    def close(self) -> None:  # noqa: B027 - not every kind has something to close
        """Close the line."""


@contextlib.asynccontextmanager
async def open_line(address: str) -> AsyncIterator[Line]:
    """Open the device side of the line that a daemon opens by ``address``, for the duration of ``with``.

    Args:
        address: Path of a new pseudo-terminal; ``udp://``, ``tcp://`` or ``ws://`` with ``HOST:PORT`` to serve; the
            ``ipc://`` endpoint to push to; or the ``unix://`` path to connect to.

    Raises:
        OSError: The address cannot be served.
        ValueError: The address is invalid.
    """
    scheme = address.partition("://")[0] if "://" in address else ""
    if scheme == "ws":
        websocket = _WebsocketLine()
        async with serve(websocket.serve_client, *_host_and_port(address), compression=None):
            yield websocket
        return
    if scheme not in _KINDS:
        raise ValueError(
            f"{address}: must be a path, udp://, tcp:// or ws:// with HOST:PORT, ipc:///PATH or unix:///PATH"
        )
    with contextlib.closing(_KINDS[scheme](address)) as line:
        yield line


def _host_and_port(address: str) -> tuple[str, int]:
    parts = urlsplit(address)
    if not parts.hostname or not parts.port:
        raise ValueError(f"{address}: must have host and port, such as {parts.scheme}://127.0.0.1:5000")
    return parts.hostname, parts.port


class PtyLine(Line):
    """A raw pseudo-terminal in place of the serial port of a device; the host opens the other side by ``path``.

    Args:
        path: New symbolic link to the other side; an existing link is replaced.

    Raises:
        OSError: No pseudo-terminal is available, or the link cannot be created.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._open = False
        self._fd, other = os.openpty()
        try:
            tty.setraw(other)  # the mode stays while this side is open
            self._target = os.ttyname(other)
            os.set_blocking(self._fd, False)
            if self.path.is_symlink():
                self.path.unlink()
            self.path.symlink_to(self._target)
        except OSError:
            os.close(self._fd)
            raise
        finally:
            os.close(other)
        self._poll = select.poll()
        self._poll.register(self._fd, select.POLLIN)

    def listen(self) -> tuple[bool, list[bytes]]:
        """Return whether the other side has just been opened, and what it wrote."""
        events = dict(self._poll.poll(0)).get(self._fd, 0)
        was_open, self._open = self._open, not events & select.POLLHUP
        received: list[bytes] = []
        if events & select.POLLIN:
            with contextlib.suppress(OSError):  # the host has just gone
                received.append(os.read(self._fd, READ_BYTES))
        return self._open and not was_open, received

    def send(self, pieces: Sequence[bytes]) -> None:
        """Write without waiting; bytes that do not fit are lost, as on a line without flow control."""
        data = b"".join(pieces)
        if data and self._open:
            self.dropped += len(data)
            with contextlib.suppress(OSError):  # full, or gone since the last poll
                self.dropped -= os.write(self._fd, data)

    def close(self) -> None:
        """Remove the link unless it has been replaced, and close the pseudo-terminal.

        The link goes first: the kernel gives the name of a closed pseudo-terminal to the next one, of any program.
        """
        with contextlib.suppress(OSError):
            if str(self.path.readlink()) == self._target:
                self.path.unlink()
        os.close(self._fd)


class _UdpLine(Line):
    """Answer the last sender, as such sensors do."""

    def __init__(self, address: str) -> None:
        place = _host_and_port(address)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(place)
        self._socket.setblocking(False)
        self._peer: tuple[str, int] | None = None

    def listen(self) -> tuple[bool, list[bytes]]:
        received: list[bytes] = []
        before = self._peer
        with contextlib.suppress(OSError):  # nothing more to read, or the peer has closed its socket
            while len(received) < PIECES_PER_LOOK:
                data, self._peer = self._socket.recvfrom(READ_BYTES)
                received.append(data)
        return self._peer != before, received

    def send(self, pieces: Sequence[bytes]) -> None:
        if self._peer is not None:
            with contextlib.suppress(OSError):
                for piece in pieces:
                    self._socket.sendto(piece, self._peer)

    def close(self) -> None:
        self._socket.close()


class _StreamLine(Line):
    """One host at a time, over a stream socket."""

    _host: socket.socket | None = None

    def send(self, pieces: Sequence[bytes]) -> None:
        data = b"".join(pieces)
        if data and self._host is not None:
            with contextlib.suppress(OSError):
                self._host.send(data)

    def close(self) -> None:
        if self._host is not None:
            self._host.close()
            self._host = None

    def _read(self) -> list[bytes]:
        """Return what the host wrote; one that hung up is left."""
        if self._host is None:
            return []
        try:
            data = self._host.recv(READ_BYTES)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if not data:
            _StreamLine.close(self)
        return [data] if data else []


class _TcpLine(_StreamLine):
    """Serve one host at a time; a new one replaces it."""

    def __init__(self, address: str) -> None:
        self._server = socket.create_server(_host_and_port(address))
        self._server.setblocking(False)

    def listen(self) -> tuple[bool, list[bytes]]:
        with contextlib.suppress(BlockingIOError):
            host, _ = self._server.accept()
            super().close()
            host.setblocking(False)
            host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._host = host
            return True, []
        return False, self._read()

    def close(self) -> None:
        super().close()
        self._server.close()


class _PushLine(Line):
    """Push to a daemon once it serves."""

    def __init__(self, endpoint: str) -> None:
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._socket = self._context.socket(zmq.PUSH)
        self._socket.setsockopt(zmq.IMMEDIATE, 1)
        self._socket.setsockopt(zmq.SNDHWM, SEND_AHEAD)
        self._socket.setsockopt(zmq.RECONNECT_IVL_MAX, 1000)
        self._socket.connect(endpoint)
        self._opened = True  # nothing is ever received

    def send(self, pieces: Sequence[bytes]) -> None:
        with contextlib.suppress(zmq.Again):
            for piece in pieces:
                self._socket.send(piece, zmq.NOBLOCK)

    def close(self) -> None:
        self._context.destroy(linger=0)


class _DriverLine(_StreamLine):
    """Connect to a daemon once it serves, and again after it was gone."""

    def __init__(self, address: str) -> None:
        self._path = address.removeprefix("unix://")

    def listen(self) -> tuple[bool, list[bytes]]:
        if self._host is not None:
            return False, self._read()
        made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        made.setblocking(False)
        try:
            made.connect(self._path)
        except OSError:
            made.close()
            return False, []
        self._host = made
        return True, []


class _WebsocketLine(Line):
    def __init__(self) -> None:
        self._clients: set[ServerConnection] = set()

    async def serve_client(self, client: ServerConnection) -> None:
        self._clients.add(client)
        self._opened = True
        try:
            while True:
                data = await client.recv(decode=False)
                if len(self._received) < PIECES_PER_LOOK:
                    self._received = [*self._received, data]
        except ConnectionClosed:
            self._clients.discard(client)

    def send(self, pieces: Sequence[bytes]) -> None:
        for piece in pieces:
            broadcast(self._clients, piece.decode())


_KINDS: dict[str, Callable[[str], Line]] = {
    "": PtyLine, "udp": _UdpLine, "tcp": _TcpLine, "ipc": _PushLine, "unix": _DriverLine
}  # fmt: skip
"""The kinds of lines by the scheme of their address, but for that of a WebSocket."""
