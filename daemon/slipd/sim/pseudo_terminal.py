"""A pseudo-terminal that stands in for a device's serial port, under a name that does not change."""

from __future__ import annotations

import contextlib
import os
import select
import tty
from pathlib import Path

READ_BYTES = 4096


class PseudoTerminal:
    """The device's end of a raw pseudo-terminal; its other end is opened by ``path``.

    Args:
        path: Symbolic link to be made to the other end; one that stands there already is replaced.

    Attributes:
        path: That link.
        fd: To poll for what the other end does; never read or written but by this class.
        open: Somebody has the other end open.
        dropped: Bytes that were lost because the other end did not read.

    Raises:
        OSError: No pseudo-terminal is to be had, or the link cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.open = False
        self.dropped = 0
        self.fd, other = os.openpty()
        try:
            tty.setraw(other)  # the mode outlives this closing: the pair keeps it while our end is open
            self._target = os.ttyname(other)
            os.set_blocking(self.fd, False)
            if path.is_symlink():
                path.unlink()
            path.symlink_to(self._target)
        except OSError:
            os.close(self.fd)
            raise
        finally:
            os.close(other)

    def note(self, events: int) -> bool:
        """Take the result of a poll; True when the other end has just been opened."""
        was_open, self.open = self.open, not events & select.POLLHUP
        return self.open and not was_open

    def read(self) -> bytes:
        """What the other end has written; empty when nothing, or when it is gone."""
        try:
            return os.read(self.fd, READ_BYTES)
        except OSError:
            return b""

    def write(self, data: bytes) -> None:
        """Write without waiting; what does not fit is lost, as on a line without flow control."""
        if not (data and self.open):
            return
        written = 0
        with contextlib.suppress(OSError):  # full, or gone since the last poll
            written = os.write(self.fd, data)
        self.dropped += len(data) - written

    def close(self) -> None:
        """Close, and take the link away unless it is another's by now."""
        os.close(self.fd)
        with contextlib.suppress(OSError):
            if str(self.path.readlink()) == self._target:
                self.path.unlink()
