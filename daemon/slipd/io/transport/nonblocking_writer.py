"""Write to a port or stream at once or not at all, but complete a partial write."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable


class NonblockingWriter:
    """Write to a non-blocking file descriptor; only the rest of one write is ever queued.

    Args:
        fd: Descriptor of the port or socket.
        on_error: Called with the error that ends the connection.
    """

    def __init__(self, fd: int, on_error: Callable[[OSError], None]) -> None:
        self._loop = asyncio.get_running_loop()
        self._fd = fd
        self._on_error = on_error
        self._rest = b""
        self._stopped = False

    @property
    def under_way(self) -> bool:
        """Whether the rest of a partial write still waits; other writes are refused until it is sent."""
        return bool(self._rest)

    def write(self, data: bytes) -> bool:
        """Send at once or not at all; return False while the peer does not read."""
        if self._rest or self._stopped:
            return False
        sent = self._send(data)
        if 0 < sent < len(data):
            self._rest = data[sent:]
            self._loop.add_writer(self._fd, self._send_rest)
        return sent > 0 or not data

    def stop(self) -> None:
        """Stop writing; call this before the descriptor is closed, because its number may be reused."""
        if not self._stopped:
            self._stopped = True
            self._rest = b""
            self._loop.remove_writer(self._fd)

    def _send(self, data: bytes) -> int:
        try:
            return os.write(self._fd, data)
        except BlockingIOError:
            return 0
        except OSError as error:
            self._on_error(error)
            return 0

    def _send_rest(self) -> None:
        sent = self._send(self._rest)
        self._rest = self._rest[sent:]
        if not self._rest and not self._stopped:
            self._loop.remove_writer(self._fd)
