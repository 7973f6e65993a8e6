"""Writes to a port or stream now or never, and completes what was taken in part: the rest, or the next is garbled."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable


class NonblockingWriter:
    """Sends on a non-blocking file descriptor; nothing waits in a queue but the rest of one write.

    Args:
        fd: Of the port or socket.
        on_error: Called with what shows that it takes no more.
    """

    def __init__(self, fd: int, on_error: Callable[[OSError], None]) -> None:
        self._loop = asyncio.get_running_loop()
        self._fd = fd
        self._on_error = on_error
        self._rest = b""
        self._stopped = False

    @property
    def under_way(self) -> bool:
        """A write was taken in part; others are refused until its rest has gone."""
        return bool(self._rest)

    def write(self, data: bytes) -> bool:
        """Send at once or not at all; False while the peer does not read."""
        if self._rest or self._stopped:
            return False
        sent = self._send(data)
        if 0 < sent < len(data):
            self._rest = data[sent:]
            self._loop.add_writer(self._fd, self._send_rest)
        return sent > 0 or not data

    def stop(self) -> None:
        """Send no more; to be called before the descriptor is closed, for its number may soon be another's."""
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
