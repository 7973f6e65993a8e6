"""A ZeroMQ context for peers inside the test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zmq

Context = zmq.Context[zmq.Socket[bytes]]


class StandingClock:
    """In place of the module ``time``: however long a test takes, no allowance grows meanwhile."""

    @staticmethod
    def monotonic_ns() -> int:
        return 0


class Peer:
    """A client that collects what it receives."""

    def __init__(self, context: Context, kind: int, endpoint: str, **options: int | bytes) -> None:
        self.socket = context.socket(kind)
        for name, value in {"LINGER": 0, **options}.items():
            self.socket.setsockopt(getattr(zmq, name), value)
        self.socket.connect(endpoint)
        self._got: list[list[bytes]] = []

    @property
    def got(self) -> list[list[bytes]]:
        """Every message so far."""
        try:
            while True:
                self._got.append(self.socket.recv_multipart(zmq.NOBLOCK))
        except zmq.Again:
            return self._got


@pytest.fixture
def context() -> Iterator[Context]:
    context: Context = zmq.Context()
    yield context
    context.destroy(linger=0)


@pytest.fixture
def clients() -> Iterator[Context]:
    """A context apart, as clients in another process have."""
    context: Context = zmq.Context()
    yield context
    context.destroy(linger=0)


@pytest.fixture
def peer(clients: Context) -> Iterator[Callable[..., Peer]]:
    peers: list[Peer] = []

    def connect(kind: int, endpoint: str, **options: int | bytes) -> Peer:
        peers.append(Peer(clients, kind, endpoint, **options))
        return peers[-1]

    yield connect
    for each in peers:
        each.socket.close()


@pytest.fixture
def endpoint(tmp_path: Path) -> str:
    return f"ipc://{tmp_path}/s"
