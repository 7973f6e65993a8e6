"""The device side of a real line: a pseudo-terminal, a socket or a server. Bytes that nobody reads are lost."""

from __future__ import annotations

import asyncio
import contextlib
import os
import select
import tty
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import zmq
from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.exceptions import ConnectionClosed

READ_BYTES = 65_536
PIECES_PER_LOOK = 64
"""Most pieces kept of a host that floods the line, until they are read."""

RETRY_S = 0.01
"""Time between two attempts to connect to a daemon that does not serve yet, s."""

SEND_AHEAD = 64
"""Messages queued for a daemon that does not read."""


class Line(ABC):
    """The device side of a line; see `open_line` for the kinds."""

    dropped = 0
    """Bytes that are known to be lost because the host did not read."""

    _opened = False
    _received: Sequence[bytes] = ()

    def _receive(self, data: bytes) -> None:
        """Keep a piece for `listen`; a host that floods the line loses the rest."""
        if len(self._received) < PIECES_PER_LOOK:
            self._received = [*self._received, data]

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
    scheme, _, place = address.partition("://")
    async with contextlib.AsyncExitStack() as stack:
        if "://" not in address:
            yield stack.enter_context(contextlib.closing(PtyLine(address)))
        elif scheme == "ipc":
            yield stack.enter_context(contextlib.closing(_PushLine(address)))
        elif scheme == "ws":
            websocket = _WebsocketLine()
            await stack.enter_async_context(serve(websocket.serve, *_host_and_port(address), compression=None))
            yield websocket
        elif scheme == "udp":
            datagrams, loop = _DatagramLine(), asyncio.get_running_loop()
            await loop.create_datagram_endpoint(lambda: datagrams, _host_and_port(address))
            yield stack.enter_context(contextlib.closing(datagrams))
        elif scheme in ("tcp", "unix"):
            stream = _StreamLine()
            if scheme == "tcp":
                await stack.enter_async_context(await asyncio.start_server(stream.serve, *_host_and_port(address)))
            else:
                stack.callback(asyncio.create_task(stream.connect(place)).cancel)
            yield stack.enter_context(contextlib.closing(stream))
        else:
            raise ValueError(
                f"{address}: must be a path, udp://, tcp:// or ws:// with HOST:PORT, ipc:///PATH or unix:///PATH"
            )


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


class _DatagramLine(Line, asyncio.DatagramProtocol):
    """Answer the last sender, as such sensors do."""

    _peer: tuple[str, int] | None = None

    def connection_made(self, transport: Any) -> None:
        self._transport: asyncio.DatagramTransport = transport

    def datagram_received(self, data: bytes, peer: tuple[str, int]) -> None:
        self._opened, self._peer = self._opened or peer != self._peer, peer
        self._receive(data)

    def send(self, pieces: Sequence[bytes]) -> None:
        if self._peer is not None:
            for piece in pieces:
                self._transport.sendto(piece, self._peer)

    def close(self) -> None:
        self._transport.abort()


class _StreamLine(Line):
    """Serve one host at a time over a stream; a new one replaces it."""

    _host: asyncio.StreamWriter | None = None

    async def serve(self, reader: asyncio.StreamReader, host: asyncio.StreamWriter) -> None:
        self.close()
        self._host, self._opened, self._received = host, True, ()
        with contextlib.suppress(OSError):
            while data := await reader.read(READ_BYTES):
                self._receive(data)
        if self._host is host:
            self.close()

    async def connect(self, path: str) -> None:
        """Connect to a daemon once it serves, and again after it was gone."""
        while True:
            with contextlib.suppress(OSError):
                await self.serve(*await asyncio.open_unix_connection(path))
            await asyncio.sleep(RETRY_S)

    def send(self, pieces: Sequence[bytes]) -> None:
        if self._host is not None and not self._host.transport.get_write_buffer_size():
            self._host.write(b"".join(pieces))

    def close(self) -> None:
        if self._host is not None:
            self._host.transport.abort()
            self._host = None


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


class _WebsocketLine(Line):
    def __init__(self) -> None:
        self._clients: set[ServerConnection] = set()

    async def serve(self, client: ServerConnection) -> None:
        self._clients.add(client)
        self._opened = True
        try:
            while True:
                self._receive(await client.recv(decode=False))
        except ConnectionClosed:
            self._clients.discard(client)

    def send(self, pieces: Sequence[bytes]) -> None:
        for piece in pieces:
            broadcast(self._clients, piece.decode())
