"""One connected ZeroMQ socket with the context it lives in: what Subscriber and Requester share."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping

import zmq

HEARTBEAT_MS = 1000
"""Asks the peer for a sign of life, so that a cut cable is noticed although TCP itself says nothing."""

HEARTBEAT_TIMEOUT_MS = 3000
"""Three signs of life missed: the peer is gone, and ZeroMQ connects anew."""


class Link:
    """Owns a context and a socket; both are closed without waiting for anything still to be sent.

    Args:
        kind: Socket type, e.g. ``zmq.SUB``.
        endpoint: Where to connect, e.g. ``ipc:///run/slipd/publish``.
        options: Further socket options.

    Raises:
        ValueError: The endpoint is none.
    """

    def __init__(self, kind: int, endpoint: str, options: Mapping[int, int]) -> None:
        self.endpoint = endpoint
        self._context = zmq.Context()
        self.socket = self._context.socket(kind)
        self.socket.setsockopt(zmq.LINGER, 0)
        self.socket.setsockopt(zmq.HEARTBEAT_IVL, HEARTBEAT_MS)
        self.socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, HEARTBEAT_TIMEOUT_MS)
        for option, value in options.items():
            self.socket.setsockopt(option, value)
        try:
            self.socket.connect(endpoint)
        except zmq.ZMQError as error:
            self.close()
            raise ValueError(
                f"cannot connect to {endpoint!r} ({error}); an endpoint is ipc:///run/slipd/publish or tcp://127.0.0.1:5555"
            ) from error

    def wait(self, event: int, until: float | None) -> bool:
        """Wait until the socket is ready for ``event``.

        Args:
            event: ``zmq.POLLIN`` or ``zmq.POLLOUT``.
            until: On ``time.monotonic``; None waits for ever.

        Returns:
            Whether it is ready.
        """
        left_ms = None if until is None else max(0, math.ceil((until - time.monotonic()) * 1000))
        return self.socket.poll(left_ms, event) != 0

    def close(self) -> None:
        """Close both; a second call does nothing."""
        self.socket.close(linger=0)
        self._context.term()
