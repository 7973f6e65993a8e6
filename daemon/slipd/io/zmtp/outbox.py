"""Send queue of one connection: messages go to the kernel at once, or wait in a bounded queue until the peer reads."""

from __future__ import annotations

import asyncio
import socket
from collections import deque
from collections.abc import Callable

Message = tuple[bytes, ...]

WRITE_BYTES = 64 * 1024
"""Most bytes of the queue passed to the kernel at once."""


class Outbox:
    """Sends messages on one connection without ever waiting for the peer.

    Args:
        connection: The non-blocking socket; its owner closes the outbox first.
        seal: Encodes a message for the wire. The queue holds messages unsealed, so that all peers share the same one.
        most: Messages queued for a peer that does not read.
        drops_oldest: A full queue drops its oldest message, not the new one.
        on_gone: Called when the peer turns out to be gone.

    Attributes:
        sent_bytes: Bytes that the kernel accepted.
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
        self._rest = b""  # of a partial write
        self._closed = False
        self.sent_bytes = 0

    @property
    def waiting(self) -> int:
        """Number of messages that wait until the peer reads, including a partially sent one."""
        return len(self._queue) + bool(self._rest)

    def send(self, message: Message) -> bool:
        """Send a message, or queue it until the peer reads; return False if it is dropped."""
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
        """Send bytes after the rest of a partial write, and before all queued messages."""
        if self._closed or not data:
            return
        if self._rest:
            self._rest += data
            return
        sent = self._write(data)
        if sent < len(data) and not self._closed:
            self._rest = data[sent:]
            self._loop.add_writer(self._fd, self.flush)

    def flush(self) -> None:
        """Pass as much of the queue to the kernel as it accepts."""
        if self._closed or not self.waiting:
            return
        while self._queue and len(self._rest) < WRITE_BYTES:
            self._rest += self._seal(self._queue.popleft())
        self._rest = self._rest[self._write(self._rest) :]
        if not self._closed and not self.waiting:
            self._loop.remove_writer(self._fd)

    def close(self) -> None:
        """Stop sending and drop the queue."""
        self._closed = True
        self._loop.remove_writer(self._fd)
        self._queue.clear()
        self._rest = b""

    def _write(self, data: bytes) -> int:
        """Return how many bytes the kernel accepted."""
        try:
            sent = self._connection.send(data)
        except (BlockingIOError, InterruptedError):
            return 0
        except OSError:
            self._on_gone()
            return 0
        self.sent_bytes += sent
        return sent
