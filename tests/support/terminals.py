"""A terminal for programs under test: a real pseudo-terminal, and the screen that an emulator draws of its bytes."""

from __future__ import annotations

import fcntl
import os
import pty
import select
import struct
import termios
import time
from collections.abc import Callable
from contextlib import AbstractContextManager

import pyte
from rig_parts import PATIENCE_S


class PseudoTerminal(AbstractContextManager["PseudoTerminal"]):
    """The user's side of a pseudo-terminal. Use it in a ``with`` statement.

    Attributes:
        slave: Descriptor for the program; close it once the program has it.
        sent: Every byte that the program wrote.
    """

    def __init__(self, columns: int = 80, lines: int = 24) -> None:
        self._master, self.slave = pty.openpty()
        self.sent = b""
        self._screen = pyte.Screen(columns, lines)
        self._stream = pyte.ByteStream(self._screen)
        fcntl.ioctl(self._master, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))

    def wait_for(
        self, condition: Callable[[list[str]], object], meanwhile: Callable[[], object] = lambda: None
    ) -> list[str]:
        """Read until the lines of the screen meet a condition; return them without blanks at their ends."""
        until = time.monotonic() + PATIENCE_S
        while not condition(self.lines):
            assert time.monotonic() < until, "\n".join(["the screen stays", *self.lines])
            meanwhile()
            self.read(0.02)
        return self.lines

    def read(self, seconds: float) -> bool:
        """Read what arrives within some seconds; return whether anything did."""
        if not select.select([self._master], [], [], seconds)[0]:
            return False
        try:
            data = os.read(self._master, 65536)
        except OSError:  # every program has closed it
            return False
        self.sent += data
        self._stream.feed(data)
        return bool(data)

    def read_all(self) -> None:
        """Read until nothing more arrives."""
        while self.read(0.1):
            pass

    @property
    def lines(self) -> list[str]:
        """Lines of the screen without blanks at their ends."""
        return [line.rstrip() for line in self._screen.display]

    @property
    def cursor_hidden(self) -> bool:
        """Whether the cursor is hidden."""
        return bool(self._screen.cursor.hidden)

    def type(self, text: str) -> None:
        """Type a text."""
        os.write(self._master, text.encode())

    def __exit__(self, *_: object) -> None:
        os.close(self._master)
