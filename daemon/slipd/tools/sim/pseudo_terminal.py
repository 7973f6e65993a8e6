"""A pseudo-terminal in place of the serial port of a device, under a fixed name."""

from __future__ import annotations

import contextlib
import os
import select
import tty
from pathlib import Path

READ_BYTES = 4096


class PseudoTerminal:
    """The device side of a raw pseudo-terminal; the host opens the other side by ``path``.

    Args:
        path: New symbolic link to the other side; an existing link is replaced.

    Attributes:
        path: That link.
        fd: Descriptor to poll; only this class reads or writes it.
        open: Whether the other side is open.
        dropped: Bytes that were lost because the other side did not read.

    Raises:
        OSError: No pseudo-terminal is available, or the link cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.open = False
        self.dropped = 0
        self.fd, other = os.openpty()
        try:
            tty.setraw(other)  # the mode stays while this side is open
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

    def update(self, events: int) -> bool:
        """Handle the result of a poll; return whether the other side has just been opened."""
        was_open, self.open = self.open, not events & select.POLLHUP
        return self.open and not was_open

    def read(self) -> bytes:
        """Return the bytes that the other side wrote; empty if there are none, or if it is gone."""
        try:
            return os.read(self.fd, READ_BYTES)
        except OSError:
            return b""

    def write(self, data: bytes) -> None:
        """Write without waiting; bytes that do not fit are lost, as on a line without flow control."""
        if not (data and self.open):
            return
        written = 0
        with contextlib.suppress(OSError):  # full, or gone since the last poll
            written = os.write(self.fd, data)
        self.dropped += len(data) - written

    def close(self) -> None:
        """Remove the link unless it has been replaced, and close the pseudo-terminal.

        The link goes first: the kernel gives the name of a closed pseudo-terminal to the next one, of any program.
        """
        with contextlib.suppress(OSError):
            if str(self.path.readlink()) == self._target:
                self.path.unlink()
        os.close(self.fd)
