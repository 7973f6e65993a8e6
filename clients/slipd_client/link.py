"""One connected ZeroMQ socket with its context: the connection of every client of this library."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Coroutine, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

import zmq

from slipd_client.errors import CallError, ConnectionClosed
from slipd_client.keys import Keys
from slipd_client.paths import claim_socket

KEEPALIVE: dict[int, int] = {
    zmq.TCP_KEEPALIVE: 1,
    zmq.TCP_KEEPALIVE_IDLE: 1,
    zmq.TCP_KEEPALIVE_INTVL: 1,
    zmq.TCP_KEEPALIVE_CNT: 2,
    zmq.TCP_MAXRT: 3000,
}
"""The kernel probes the peer each second and drops the connection after three: so a cut cable is noticed.

ZeroMQ's own heartbeats abort the whole process (an assertion in ``stream_engine_base_t::out_event``) when the peer dies
while more than RCVHWM of its messages are unread: a slow subscriber would die with its daemon.
"""


class Link:
    """Owns a context and a socket; closing drops what was not sent yet.

    Args:
        kind: Socket type, e.g. ``zmq.SUB``.
        endpoint: Where to connect, e.g. ``ipc:///run/slipd/publish``.
        keys: Keys of this client, for a daemon that asks for them; None on endpoints of this machine.
        options: Further socket options.

    Raises:
        CallError: ``endpoint`` is not a ZeroMQ endpoint, or another user could listen there in place of the daemon.
    """

    def __init__(
        self, kind: int, endpoint: str, keys: Keys | None = None, options: Mapping[int, int] | None = None
    ) -> None:
        self.endpoint = endpoint
        _check_trust(endpoint)
        self._context = zmq.Context()
        self.socket = self._context.socket(kind)
        self.socket.setsockopt(zmq.LINGER, 0)
        for option, value in (KEEPALIVE | dict(options or {})).items():
            self.socket.setsockopt(option, value)
        try:
            if keys is not None:
                keys.apply(self.socket)
            self.socket.connect(endpoint)
        except (zmq.ZMQError, TypeError) as error:
            self.close()
            raise CallError(
                "endpoint must be of the form ipc:///run/slipd/publish or tcp://127.0.0.1:5555, "
                f"got {endpoint!r} ({error})"
            ) from error

    def receive(self, until: float | None) -> list[bytes] | None:
        """Wait for one message; None where none arrived before ``until``.

        Args:
            until: On ``time.monotonic``; None waits for ever.

        Raises:
            ConnectionClosed: The link is closed, as for every method below.
        """
        with self._open():
            self.socket.setsockopt(zmq.RCVTIMEO, _left_ms(until))
            return self._frames(0)

    def receive_now(self) -> list[bytes] | None:
        """Return one message that has already arrived, or None."""
        with self._open():
            return self._frames(zmq.NOBLOCK)

    def newest(self, most: int) -> list[list[bytes]]:
        """Return the newest of the messages with the same first frame that have already arrived.

        Args:
            most: Most messages to take, however fast they arrive.
        """
        newest: dict[bytes, list[zmq.Frame]] = {}
        receive = self.socket.recv
        with self._open(), contextlib.suppress(zmq.Again):
            for _ in range(most):
                frames = [receive(zmq.NOBLOCK, copy=False)]  # a Frame knows whether more follow: a third of the cost
                while frames[-1].more:
                    frames.append(receive(zmq.NOBLOCK, copy=False))
                first = frames[0].bytes
                newest.pop(first, None)  # in the order of the newest messages
                newest[first] = frames
        return [[frame.bytes for frame in frames] for frames in newest.values()]

    def send(self, data: bytes) -> bool:
        """Send one frame; False where no peer is connected, and then nothing is sent."""
        with self._open():
            try:
                self.socket.send(data, zmq.NOBLOCK)
            except zmq.Again:
                return False
            return True

    def wait_writable(self, until: float) -> bool:
        """Wait until ``until`` (on ``time.monotonic``) for a peer to send to; return whether there is one."""
        with self._open():
            return self.socket.poll(_left_ms(until), zmq.POLLOUT) != 0

    def close(self) -> None:
        """Close socket and context; a second call does nothing."""
        self.socket.close(linger=0)
        self._context.term()

    def _frames(self, flags: int) -> list[bytes] | None:
        try:
            return self.socket.recv_multipart(flags)
        except zmq.Again:
            return None

    @contextlib.contextmanager
    def _open(self) -> Iterator[None]:
        try:
            yield
        except zmq.ZMQError:
            if self.socket.closed:
                raise ConnectionClosed(f"the connection to {self.endpoint} was closed") from None
            raise


T = TypeVar("T")
Steps = Coroutine[Any, Any, T]
"""Steps of a request or a receive, written once for both kinds of client. They wait by the methods of `Blocking`, or of
its counterpart for asyncio."""

AnyBlocking = TypeVar("AnyBlocking", bound="Blocking")


class Blocking:
    """Owns a connection and waits by blocking; best used in a ``with`` statement."""

    _link: Link

    def _run(self, steps: Steps[T]) -> T:
        """Carry out steps to their end: they never suspend, because every wait blocks."""
        try:
            steps.send(None)
        except StopIteration as done:
            return done.value  # type: ignore[no-any-return]
        raise RuntimeError("steps of a blocking client must not await a loop")

    async def _frames(self, until: float | None) -> list[bytes] | None:
        """Wait for a message, as `Link.receive`."""
        return self._link.receive(until)

    async def _writable(self, until: float) -> bool:
        """Wait for a peer to send to, as `Link.wait_writable`."""
        return self._link.wait_writable(until)

    def close(self) -> None:
        """Close the connection; a second call does nothing."""
        self._link.close()

    def __enter__(self: AnyBlocking) -> AnyBlocking:
        return self

    def __exit__(self, *failure: object) -> None:
        self.close()


def _check_trust(endpoint: str) -> None:
    """Refuse a socket of this machine on which another user could pretend to be the daemon.

    Raises:
        CallError: The text says which folder or socket is at fault, and what would be right.
    """
    if not isinstance(endpoint, str) or not endpoint.startswith("ipc:///"):
        return
    try:
        faults = claim_socket(Path(endpoint.removeprefix("ipc://")))
    except OSError as error:
        faults = [f"{error.filename} cannot be created: {error.strerror}"]
    if faults:
        raise CallError(f"{endpoint}: another user could listen here in place of the daemon: {'; '.join(faults)}")


def _left_ms(until: float | None) -> int:
    return -1 if until is None else max(0, math.ceil((until - time.monotonic()) * 1000))
