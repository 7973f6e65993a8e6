"""One connected ZeroMQ socket with the context it lives in: what every client of this library stands on."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING

import zmq

if TYPE_CHECKING:
    from slipd_client.keys import Keys

KEEPALIVE: dict[int, int] = {
    zmq.TCP_KEEPALIVE: 1,
    zmq.TCP_KEEPALIVE_IDLE: 1,
    zmq.TCP_KEEPALIVE_INTVL: 1,
    zmq.TCP_KEEPALIVE_CNT: 2,
    zmq.TCP_MAXRT: 3000,
}
"""The kernel asks the peer for a sign of life each second, and gives it up after three: so a cut cable is noticed.

ZeroMQ's own heartbeats abort the whole process (an assertion in ``stream_engine_base_t::out_event``) when the peer dies
while more than RCVHWM of what it sent is unread: a slow subscriber would die with its daemon.
"""


class Link:
    """Owns a context and a socket; both are closed without waiting for anything still to be sent.

    Args:
        kind: Socket type, e.g. ``zmq.SUB``.
        endpoint: Where to connect, e.g. ``ipc:///run/slipd/publish``.
        keys: Who this client is, for a daemon that asks; None on endpoints of this machine.
        options: Further socket options.

    Raises:
        ValueError: The endpoint is none.
    """

    def __init__(
        self, kind: int, endpoint: str, keys: Keys | None = None, options: Mapping[int, int] | None = None
    ) -> None:
        self.endpoint = endpoint
        self._context = zmq.Context()
        self.socket = self._context.socket(kind)
        self.socket.setsockopt(zmq.LINGER, 0)
        for option, value in (KEEPALIVE | dict(options or {})).items():
            self.socket.setsockopt(option, value)
        try:
            if keys is not None:
                keys.apply(self.socket)
            self.socket.connect(endpoint)
        except zmq.ZMQError as error:
            self.close()
            raise ValueError(
                f"cannot connect to {endpoint!r} ({error}); "
                "an endpoint is ipc:///run/slipd/publish or tcp://127.0.0.1:5555"
            ) from error

    def receive(self, until: float | None) -> list[bytes] | None:
        """Wait for one message; None where none came until then.

        Args:
            until: On ``time.monotonic``; None waits for ever.
        """
        self.socket.setsockopt(zmq.RCVTIMEO, _left_ms(until))
        return self.take(0)

    def take(self, flags: int = zmq.NOBLOCK) -> list[bytes] | None:
        """One message that is there already; None where none is."""
        try:
            return self.socket.recv_multipart(flags)
        except zmq.Again:
            return None

    def wait_writable(self, until: float) -> bool:
        """Wait until somebody is there to send to; whether there is. ``until`` is on ``time.monotonic``."""
        return self.socket.poll(_left_ms(until), zmq.POLLOUT) != 0

    def close(self) -> None:
        """Close both; a second call does nothing."""
        self.socket.close(linger=0)
        self._context.term()


def _left_ms(until: float | None) -> int:
    return -1 if until is None else max(0, math.ceil((until - time.monotonic()) * 1000))
