"""Send queue of one connection: messages go to the kernel at once, or wait in a bounded queue until the peer reads."""

from __future__ import annotations

import asyncio
import socket
from collections import deque
from collections.abc import Callable

Message = tuple[bytes, ...]

WRITE_BYTES = 64 * 1024
"""Given to the kernel at once of what waited."""


class Outbox:
    """Sends messages on one connection without ever waiting for the peer.

    Args:
        connection: Non-blocking; whoever owns it closes the outbox first.
        seal: Encodes a message for the wire. Messages are kept unsealed, so that all peers that wait for the
            same one share it.
        most: Messages kept for a peer that does not read.
        drops_oldest: Beyond those the oldest is dropped, not the new one.
        on_gone: Called when the peer is found to be gone.
    """

    def __init__(
        self,
        connection: socket.socket,
        seal: Callable[[Message], bytes],
        most: int,
        *,
        drops_oldest: bool,
        on_gone: Callable[[], None],
    ) -> None:
        self._connection, self._fd = connection, connection.fileno()
        self._seal, self._on_gone = seal, on_gone
        self._most, self._drops_oldest = most, drops_oldest
        self._loop = asyncio.get_running_loop()
        self._queue: deque[Message] = deque(maxlen=most if drops_oldest else None)
        self._rest = b""  # of what the kernel took in part
        self._closed = False

    @property
    def waiting(self) -> int:
        """Messages that wait until the peer reads, the one that the kernel took in part included."""
        return len(self._queue) + bool(self._rest)

    def send(self, message: Message) -> bool:
        """Send a message, or keep it until the peer reads; False where it is dropped."""
        if self._closed:
            return False
        if not self._rest and not self._queue:
            self.send_now(self._seal(message))
            return True
        if not self._drops_oldest and len(self._queue) >= self._most:
            return False
        self._queue.append(message)
        return True

    def send_now(self, data: bytes) -> None:
        """Send bytes behind what the kernel took in part, and before every message that waits."""
        if self._closed or not data:
            return
        if self._rest:
            self._rest += data
            return
        sent = self._give(data)
        if sent < len(data) and not self._closed:
            self._rest = data[sent:]
            self._loop.add_writer(self._fd, self.flush)

    def flush(self) -> None:
        """Hand the kernel as much as it takes of what waits."""
        if self._closed or not self.waiting:
            return
        while self._queue and len(self._rest) < WRITE_BYTES:
            self._rest += self._seal(self._queue.popleft())
        self._rest = self._rest[self._give(self._rest) :]
        if not self._closed and not self.waiting:
            self._loop.remove_writer(self._fd)

    def close(self) -> None:
        """Send no more and forget what waits."""
        self._closed = True
        self._loop.remove_writer(self._fd)
        self._queue.clear()
        self._rest = b""

    def _give(self, data: bytes) -> int:
        """Return how many bytes the kernel took."""
        try:
            return self._connection.send(data)
        except (BlockingIOError, InterruptedError):
            return 0
        except OSError:
            self._on_gone()
            return 0
