"""A ZeroMQ context for peers inside the test, and bounded waits for them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import zmq

PATIENCE_S = 30.0

Context = zmq.Context[zmq.Socket[bytes]]
Eventually = Callable[[Callable[[], object]], Awaitable[None]]


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


@pytest.fixture
def eventually() -> Eventually:
    async def wait(condition: Callable[[], object]) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while not condition():  # noqa: ASYNC110 - what it waits for happens in other threads
                await asyncio.sleep(0.001)

    return wait


@pytest.fixture
async def loop_faults() -> AsyncIterator[list[dict[str, Any]]]:
    """What reached the loop's exception handler; a daemon dies of any, so a test that expects some clears it."""
    faults: list[dict[str, Any]] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: faults.append(context))
    yield faults
    assert faults == []
