"""Terminals: lines of coloured text, the screen that they are drawn on, and what an output stream can show."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from types import FrameType
from typing import TextIO

INTERRUPTED = 130
"""Exit code after Ctrl-C."""

UNCUT = 10_000
"""Columns and lines without a terminal: more than is ever drawn."""


@dataclass(frozen=True, slots=True)
class Terminal:
    """What the view is drawn for.

    Attributes:
        columns: Columns; facts and reasons continue on the next line.
        lines: Lines; what is left out for want of them is named in the last one.
        colour: Whether to add ANSI colours.
    """

    columns: int = UNCUT
    lines: int = UNCUT
    colour: bool = False


@contextlib.contextmanager
def standard_output(program: str) -> Iterator[None]:
    """Serve the output of a program: what a stream cannot show is a "?", and one that is closed shows nothing.

    A reader that closes its pipe ends the block without an error.

    Raises:
        SystemExit: The disk that takes the output is full, or a file that was named cannot be reached.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: PTH123, SIM115
        getattr(sys, name).reconfigure(errors="replace")
    try:
        try:
            yield
        finally:
            sys.stdout.flush()
    except OSError as error:
        if error.filename is not None:  # a name that is too long, or a folder that this user may not search
            raise SystemExit(f"{program}: {error.filename}: {error.strerror}") from None
        if error.errno not in (errno.EPIPE, errno.ENOSPC):
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python flushes once more at exit
        if error.errno == errno.ENOSPC:
            raise SystemExit(f"{program}: the output cannot be written: {error.strerror}") from None


UNKNOWN = "\N{EN DASH}"
"""Stands for what is not known."""


def plain(text: str | None) -> str:
    """Return a string from the daemon without control characters, which would move the cursor."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text or "") or UNKNOWN


def clock_time(timestamp: float) -> str:
    """Return the local time of day with milliseconds; "–" for 0, which is no time, and for times out of range."""
    if not timestamp:
        return UNKNOWN
    try:
        return datetime.fromtimestamp(timestamp).astimezone().strftime("%H:%M:%S.%f")[:-3]
    except (ValueError, OverflowError, OSError):
        return UNKNOWN


Span = tuple[str, str]
"""Text, and the parameters of its ANSI colour ("" for none)."""

Line = list[Span]

GAP = 2
"""Columns between two facts of a line."""


class Sheet:
    """Lines that grow from above to below, each at most ``width`` columns.

    Args:
        width: Columns.

    Attributes:
        width: Columns.
        lines: The lines so far.
    """

    def __init__(self, width: int) -> None:
        self.width = width
        self.lines: list[Line] = []

    def facts(self, head: Iterable[Span], facts: Iterable[Span] = (), indent: int = 0) -> None:
        """Add the head and as many facts as fit beside it; the others follow on lines of their own, indented.

        Only a head or a fact that is longer than a line is cut.
        """
        line = list(head)
        used, empty = _columns(line), not line
        for text, colour in facts:
            if not empty and used + GAP + len(text) > self.width:
                self.lines.append(line)
                line, used, empty = [(" " * indent, "")], indent, True
            gap = 0 if empty else GAP
            line += [(" " * gap, ""), (text, colour)]
            used, empty = used + gap + len(text), False
        self.lines.append(line)

    def remark(self, text: str, colour: str, indent: int = 0) -> None:
        """Add a text that is never cut: after the last line where it fits there, else on lines of its own."""
        if text and self.lines and _columns(self.lines[-1]) + GAP + len(text) <= self.width:
            self.lines[-1] += [(" " * GAP, ""), (text, colour)]
        else:
            self.paragraph(text, colour, indent)

    def paragraph(self, text: str, colour: str, indent: int = 0) -> None:
        """Add a text that is never cut, on lines of its own; "" adds none."""
        blank = " " * min(indent, self.width // 4)
        if len(blank) + len(text) <= self.width:
            self.lines += [[(blank, ""), (text, colour)]] if text else []
            return
        wrapped = textwrap.wrap(text, max(self.width - len(blank), 1))
        self.lines += [[(blank, ""), (line, colour)] for line in wrapped]


def paint(line: Line, width: int, *, colour: bool) -> str:
    """Join the spans of a line, cut to ``width`` visible columns, without blanks at its end."""
    painted = ""
    for text, code in line:
        shown = text[:width]
        width -= len(shown)
        painted += f"\x1b[{code}m{shown}\x1b[0m" if colour and code and shown else shown
    return painted.rstrip(" ")


def _columns(line: Line) -> int:
    return sum(len(text) for text, _ in line)


_ENTER = "\x1b[?1049h\x1b[?25l\x1b[?7l\x1b[2J"
"""The alternate screen, without cursor, without line breaks at the edge; cleared where there is no alternate screen."""

_LEAVE = "\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l"

_HOME = "\x1b[H"
"""The cursor waits here: what somebody types cannot scroll the picture."""


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
        ends = dict.fromkeys((signal.SIGTERM, signal.SIGHUP), signal.default_int_handler)
        for number, handler in (ends | {signal.SIGTSTP: self._pause}).items():
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, handler)
                self._handled.append(number)
        self._write(_ENTER)
        return self

    def __exit__(self, *failure: object) -> None:
        self._give_back()
        for number in self._handled:
            signal.signal(number, signal.SIG_DFL)

    def _give_back(self) -> None:
        """Leave the alternate screen; where the terminal has none, the prompt comes below the picture."""
        with contextlib.suppress(BrokenPipeError):
            self._write(f"\x1b[{len(self._shown) + 1}H{_LEAVE}")

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


DEFAULT_SIZE = os.terminal_size((80, 24))
"""Of a serial console, which reports 0."""


def is_screen(stream: TextIO) -> bool:
    """Return whether a stream is a terminal with a movable cursor."""
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def terminal_of(stream: TextIO, columns: int, lines: int) -> Terminal:
    """Return what to draw for, given the room that there is."""
    colour = is_screen(stream) and not os.environ.get("NO_COLOR")
    return Terminal(columns, lines, colour)


def size_of(stream: TextIO) -> os.terminal_size:
    """Return the size of a terminal; any other stream has room for everything."""
    if not stream.isatty():
        return os.terminal_size((UNCUT, UNCUT))
    size = os.get_terminal_size(stream.fileno())
    return size if size.columns and size.lines else DEFAULT_SIZE
