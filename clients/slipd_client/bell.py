"""Wakes an asyncio loop when a ZeroMQ socket has something to tell; half the cost of ``zmq.asyncio``, and safe.

A receive of ``zmq.asyncio`` that is cancelled loses the message it had already taken. Here nothing is received
until somebody who is awake receives it, so there is nothing that a cancellation could lose.
"""

from __future__ import annotations

import asyncio
import time
from typing import Any

import zmq


class Bell:
    """Rings while a socket is ready for reading or writing, in the loop that runs when it is made.

    ZeroMQ's file descriptor tells of each change once: so look (`look`) after every use of the socket, and receive
    until nothing is left before waiting.
    """

    def __init__(self, socket: zmq.Socket[Any]) -> None:
        self._socket = socket
        self._loop = asyncio.get_running_loop()
        self._events: dict[int, asyncio.Event] = {zmq.POLLIN: asyncio.Event(), zmq.POLLOUT: asyncio.Event()}
        self._loop.add_reader(socket.FD, self.look)

    def look(self) -> None:
        """See what the socket is ready for, and wake who waits for it."""
        ready = int(self._socket.getsockopt(zmq.EVENTS))
        for event, told in self._events.items():
            if ready & event:
                told.set()

    async def wait(self, event: int, until: float | None) -> None:
        """Wait until the socket may be ready for ``event``, or ``until`` (on ``time.monotonic``) has come.

        Which of them it was must be seen by trying.
        """
        told = self._events[event]
        told.clear()
        self.look()
        end = None if until is None else self._loop.call_later(until - time.monotonic(), told.set)
        try:
            await told.wait()
        finally:
            if end is not None:
                end.cancel()

    def stop(self) -> None:
        """Leave the loop; before the socket is closed."""
        self._loop.remove_reader(self._socket.FD)
