"""The device's end of a real line: a pseudo-terminal, a socket or a server, looked at when it suits the device.

Nothing here waits: what nobody takes is lost, as on a line.
"""

from __future__ import annotations

import contextlib
import select
import socket
from collections.abc import AsyncIterator, Iterator, Sequence
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

import zmq
from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.exceptions import ConnectionClosed

from slipd.sim.pseudo_terminal import PseudoTerminal

READ_BYTES = 65_536
PIECES_PER_LOOK = 64
"""Most pieces taken at once from a host that floods."""

SEND_AHEAD = 64
"""Messages kept for a daemon that does not read."""


class Line(Protocol):
    """The device's end; see `open_line` for the kinds."""

    def listen(self) -> tuple[bool, list[bytes]]:
        """Return whether somebody has just opened the line, and what was written to it."""
        ...

    def send(self, pieces: Sequence[bytes]) -> None:
        """Send pieces: frames, messages or datagrams; without waiting, and to nobody where nobody listens."""
        ...


@contextlib.asynccontextmanager
async def open_line(address: str) -> AsyncIterator[Line]:
    """The device's end of the line that a daemon opens by ``address``, until the end of the ``with`` block.

    Args:
        address: Path of a pseudo-terminal to be made, ``udp://``, ``tcp://`` or ``ws://`` with ``HOST:PORT`` to serve
            at, or the ``ipc://`` endpoint to push to, or the ``unix://`` path to connect to.

    Raises:
        OSError: It cannot be served there.
        ValueError: The address is none.
    """
    scheme = address.partition("://")[0] if "://" in address else ""
    if scheme == "ws":
        async with _websocket_line(*_place(address)) as line:
            yield line
        return
    with contextlib.ExitStack() as stack:
        if scheme == "udp":
            yield stack.enter_context(_closing(_UdpLine(*_place(address))))
        elif scheme == "tcp":
            yield stack.enter_context(_closing(_TcpLine(*_place(address))))
        elif scheme == "ipc":
            yield stack.enter_context(_closing(_PushLine(address)))
        elif scheme == "unix":
            yield stack.enter_context(_closing(_DriverLine(address.removeprefix("unix://"))))
        elif not scheme:
            yield stack.enter_context(_closing(_PtyLine(Path(address))))
        else:
            raise ValueError(
                f"{address}: no line; give a path, udp://, tcp:// or ws:// with HOST:PORT, ipc:///PATH or unix:///PATH"
            )


def _place(address: str) -> tuple[str, int]:
    parts = urlsplit(address)
    if not parts.hostname or not parts.port:
        raise ValueError(f"{address}: give host and port, e.g. {parts.scheme}://127.0.0.1:5000")
    return parts.hostname, parts.port


class _Closable(Line, Protocol):
    def close(self) -> None: ...


@contextlib.contextmanager
def _closing(line: _Closable) -> Iterator[Line]:
    try:
        yield line
    finally:
        line.close()


def _bound(kind: socket.SocketKind, host: str, port: int) -> socket.socket:
    """A non-blocking socket at an address."""
    family, kind, protocol, _, place = socket.getaddrinfo(host, port, type=kind)[0]
    made = socket.socket(family, kind, protocol)
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind(place)
        made.setblocking(False)
    except OSError:
        made.close()
        raise
    return made


class _PtyLine:
    def __init__(self, path: Path) -> None:
        self._port = PseudoTerminal(path)
        self._poll = select.poll()
        self._poll.register(self._port.fd, select.POLLIN)

    def listen(self) -> tuple[bool, list[bytes]]:
        events = dict(self._poll.poll(0)).get(self._port.fd, 0)
        opened = self._port.note(events)
        data = self._port.read() if events & select.POLLIN else b""
        return opened, [data] if data else []

    def send(self, pieces: Sequence[bytes]) -> None:
        self._port.write(b"".join(pieces))

    def close(self) -> None:
        self._port.close()


class _UdpLine:
    """Answers to whoever spoke last, as such sensors do."""

    def __init__(self, host: str, port: int) -> None:
        self._socket = _bound(socket.SOCK_DGRAM, host, port)
        self._peer: tuple[str, int] | None = None

    def listen(self) -> tuple[bool, list[bytes]]:
        heard: list[bytes] = []
        before = self._peer
        with contextlib.suppress(OSError):  # nothing more; or the peer hung up, which is told here
            while len(heard) < PIECES_PER_LOOK:
                data, self._peer = self._socket.recvfrom(READ_BYTES)
                heard.append(data)
        return self._peer != before, heard

    def send(self, pieces: Sequence[bytes]) -> None:
        if self._peer is not None:
            with contextlib.suppress(OSError):
                for piece in pieces:
                    self._socket.sendto(piece, self._peer)

    def close(self) -> None:
        self._socket.close()


class _TcpLine:
    """Serves one host at a time; the next takes its place."""

    def __init__(self, host: str, port: int) -> None:
        self._server = _bound(socket.SOCK_STREAM, host, port)
        self._server.listen()
        self._client: socket.socket | None = None

    def listen(self) -> tuple[bool, list[bytes]]:
        with contextlib.suppress(BlockingIOError):
            client, _ = self._server.accept()
            self._leave()
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._client = client
            return True, []
        return False, self._read()

    def send(self, pieces: Sequence[bytes]) -> None:
        data = b"".join(pieces)
        if data and self._client is not None:
            with contextlib.suppress(OSError):
                self._client.send(data)

    def close(self) -> None:
        self._leave()
        self._server.close()

    def _read(self) -> list[bytes]:
        if self._client is None:
            return []
        try:
            data = self._client.recv(READ_BYTES)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if data:
            return [data]
        self._leave()
        return []

    def _leave(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None


class _PushLine:
    """Pushes to a daemon, once one is there."""

    def __init__(self, endpoint: str) -> None:
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._socket = self._context.socket(zmq.PUSH)
        self._socket.setsockopt(zmq.IMMEDIATE, 1)
        self._socket.setsockopt(zmq.SNDHWM, SEND_AHEAD)
        self._socket.setsockopt(zmq.RECONNECT_IVL_MAX, 1000)
        self._socket.connect(endpoint)
        self._begun = False

    def listen(self) -> tuple[bool, list[bytes]]:
        begun, self._begun = self._begun, True
        return not begun, []

    def send(self, pieces: Sequence[bytes]) -> None:
        with contextlib.suppress(zmq.Again):
            for piece in pieces:
                self._socket.send(piece, zmq.NOBLOCK)

    def close(self) -> None:
        self._context.destroy(linger=0)


class _DriverLine:
    """Connects to a daemon, once one is there, and again when it has left."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._socket: socket.socket | None = None

    def listen(self) -> tuple[bool, list[bytes]]:
        if self._socket is None:
            return self._connect(), []
        try:
            data = self._socket.recv(READ_BYTES)
        except BlockingIOError:
            return False, []
        except OSError:
            data = b""
        if not data:
            self.close()
        return False, [data] if data else []

    def send(self, pieces: Sequence[bytes]) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.send(b"".join(pieces))

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _connect(self) -> bool:
        made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        made.setblocking(False)
        try:
            made.connect(self._path)
        except OSError:
            made.close()
            return False
        self._socket = made
        return True


class _WebsocketLine:
    def __init__(self) -> None:
        self._clients: set[ServerConnection] = set()
        self._opened = False
        self._heard: list[bytes] = []

    async def meet(self, client: ServerConnection) -> None:
        self._clients.add(client)
        self._opened = True
        try:
            while True:
                data = await client.recv(decode=False)
                if len(self._heard) < PIECES_PER_LOOK:
                    self._heard.append(data)
        except ConnectionClosed:
            self._clients.discard(client)

    def listen(self) -> tuple[bool, list[bytes]]:
        told = self._opened, self._heard
        self._opened, self._heard = False, []
        return told

    def send(self, pieces: Sequence[bytes]) -> None:
        for piece in pieces:
            broadcast(self._clients, piece.decode())


@contextlib.asynccontextmanager
async def _websocket_line(host: str, port: int) -> AsyncIterator[Line]:
    line = _WebsocketLine()
    async with serve(line.meet, host, port, compression=None):
        yield line
