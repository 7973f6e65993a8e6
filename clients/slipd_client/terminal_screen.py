"""A picture that fills the terminal, and gives it back as it was: after Ctrl-C, Ctrl-Z, an error or a SIGTERM."""

from __future__ import annotations

import os
import signal
from collections.abc import Sequence
from types import FrameType, TracebackType
from typing import TextIO

_ENTER = "\x1b[?1049h\x1b[?25l\x1b[?7l\x1b[2J"
"""The alternate screen, without cursor, without line breaks at the edge; cleared where there is no alternate screen."""

_LEAVE = "\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l"

_HOME = "\x1b[H"
"""The cursor waits here: what somebody types cannot scroll the picture."""

_ENDS = (signal.SIGTERM, signal.SIGHUP)


class TerminalScreen:
    """Draws lines over those of before; only lines that changed are sent. Use it in a ``with`` statement.

    SIGTERM and SIGHUP end the ``with`` statement like Ctrl-C, unless the program handles them itself.

    Args:
        stream: A terminal.

    Raises:
        BrokenPipeError: The terminal is gone.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._fd = stream.fileno()
        self._shown: Sequence[str] = ()
        self._size: os.terminal_size | None = None
        self._handled: list[signal.Signals] = []

    def draw(self, lines: Sequence[str], size: os.terminal_size) -> None:
        """Show these lines, at most as many as the terminal has, each no wider than it."""
        if size != self._size:
            self._write("\x1b[2J")
            self._shown, self._size = (), size
        before = self._shown
        changed = [
            f"\x1b[{row}H\x1b[K{line}"
            for row, line in enumerate(lines, start=1)
            if row > len(before) or before[row - 1] != line
        ]
        if len(lines) < len(before):
            changed.append(f"\x1b[{len(lines) + 1}H\x1b[J")
        if changed:
            self._write("".join([*changed, _HOME]))
        self._shown = lines

    def __enter__(self) -> TerminalScreen:
        self._stream.flush()
        for number in _ENDS:
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, signal.default_int_handler)
                self._handled.append(number)
        if signal.getsignal(signal.SIGTSTP) is signal.SIG_DFL:
            signal.signal(signal.SIGTSTP, self._pause)
            self._handled.append(signal.SIGTSTP)
        self._write(_ENTER)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._give_back()
        for number in self._handled:
            signal.signal(number, signal.SIG_DFL)

    def _give_back(self) -> None:
        """Leave the alternate screen; where the terminal has none, the prompt comes below the picture."""
        try:
            self._write(f"\x1b[{len(self._shown) + 1}H{_LEAVE}")
        except BrokenPipeError:
            return

    def _pause(self, number: int, _: FrameType | None) -> None:
        """Give the terminal back for as long as the program is stopped."""
        self._give_back()
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)  # the program stops here, until SIGCONT
        signal.signal(number, self._pause)
        self._size = None
        self._write(_ENTER)

    def _write(self, text: str) -> None:
        data = text.encode(self._stream.encoding, "replace")
        try:
            while data:
                data = data[os.write(self._fd, data) :]
        except OSError as error:
            raise BrokenPipeError(error.errno, "the terminal is gone") from error
