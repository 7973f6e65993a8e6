"""ZeroMQ clients inside a test, and plain connections that speak its protocol or none."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zmq

from slipd.io.zmtp.wire import COMMAND, encode_command, encode_frame, encode_greeting, encode_metadata
from slipd_client.keys import Keys

Context = zmq.Context[zmq.Socket[bytes]]


class StandingClock:
    """In place of the module ``time``: however long a test takes, no allowance grows meanwhile."""

    @staticmethod
    def monotonic_ns() -> int:
        return 0


class Peer:
    """A client that collects what it receives."""

    def __init__(
        self, context: Context, kind: int, endpoint: str, keys: Keys | None = None, **options: int | bytes
    ) -> None:
        self.socket = context.socket(kind)
        for name, value in {"LINGER": 0, **options}.items():
            self.socket.setsockopt(getattr(zmq, name), value)
        if keys is not None:
            keys.apply(self.socket)
        self.socket.connect(endpoint)
        self._got: list[list[bytes]] = []

    @property
    def got(self) -> list[list[bytes]]:
        """Every message so far."""
        with contextlib.suppress(zmq.Again):
            while True:
                self._got.append(self.socket.recv_multipart(zmq.NOBLOCK))
        return self._got

    def can_send(self) -> int:
        """Return whether it is connected."""
        return self.socket.poll(0, zmq.POLLOUT)


Clients = Callable[..., Peer]


@pytest.fixture
def clients() -> Iterator[Context]:
    """A context apart, as clients in another process have."""
    context: Context = zmq.Context()
    yield context
    context.destroy(linger=0)


@pytest.fixture
def peer(clients: Context) -> Iterator[Clients]:
    with contextlib.ExitStack() as stack:

        def connect(kind: int, endpoint: str, keys: Keys | None = None, **options: int | bytes) -> Peer:
            made = Peer(clients, kind, endpoint, keys, **options)
            stack.callback(made.socket.close)
            return made

        yield connect


@pytest.fixture
def endpoint(tmp_path: Path) -> str:
    return f"ipc://{tmp_path}/s"


def introduction(kind: bytes) -> bytes:
    """Return how a client of this kind begins."""
    ready = encode_command(b"READY", encode_metadata({b"Socket-Type": kind}))
    return encode_greeting(b"NULL", as_server=False) + encode_frame(ready, COMMAND)


Plain = Callable[..., socket.socket]


@pytest.fixture
def plain() -> Iterator[Plain]:
    """Open a connection without ZeroMQ, and send bytes or nothing."""
    with contextlib.ExitStack() as stack:

        def connect(endpoint: str, data: bytes = b"", source: str = "127.0.0.1") -> socket.socket:
            ipc = endpoint.startswith("ipc://")
            made = stack.enter_context(socket.socket(socket.AF_UNIX if ipc else socket.AF_INET))
            made.setblocking(False)
            if not ipc:
                made.bind((source, 0))
            with contextlib.suppress(BlockingIOError):
                made.connect(
                    endpoint.removeprefix("ipc://") if ipc else ("127.0.0.1", int(endpoint.rpartition(":")[2]))
                )
            if data:
                made.sendall(data)
            return made

        yield connect


def read(connection: socket.socket) -> bytes:
    """Return all bytes that have arrived."""
    data = b""
    with contextlib.suppress(BlockingIOError):
        while piece := connection.recv(1 << 20):
            data += piece
    return data
