"""One line on a terminal that shows how far a command is."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

ERASE = "\r\x1b[K"
"""Erases the line of a terminal."""

EVERY_S = 0.1

REPEATED_S = 0.5


class Progress:
    """A bar on standard error; nothing where that is no terminal.

    A library for this would be one more dependency of the daemon's package, for twenty lines.

    Args:
        text: Returns the text beside the bar for what is done, and for all there is to do.
        now: Monotonic clock, s.
    """

    def __init__(self, text: Callable[[int, int], str], now: Callable[[], float] = time.monotonic) -> None:
        self._text = text
        self._now = now
        self._terminal = sys.stderr.isatty()
        self._begun_s: float | None = None
        self._shown_s = 0.0
        self._at_begin = 0
        self._last: tuple[int, int] | None = None

    def show(self, done: int, of: int) -> None:
        """Show that ``done`` of ``of`` are done; at most ten times a second."""
        if self._terminal:
            self._last = (done, of)
            self._draw(done, of)

    def _draw(self, done: int, of: int) -> None:
        now_s = self._now()
        if self._begun_s is None:
            self._begun_s, self._at_begin = now_s, done
        elif now_s - self._shown_s < EVERY_S and done < of:
            return
        self._shown_s = now_s
        text = self._text(done, of)
        if self._at_begin < done < of:
            left_s = (now_s - self._begun_s) / (done - self._at_begin) * (of - done)
            text += f", about {left_s:.0f} s left"
        full, empty = ("█", "·") if sys.stderr.encoding.lower() == "utf-8" else ("#", ".")
        bar = full * round(30 * done / max(of, 1))
        print(f"{ERASE}{bar:{empty}<30} {text}", end="", file=sys.stderr)

    @contextmanager
    def shown(self) -> Iterator[Callable[[int, int], None]]:
        """Give `show`; repeat what it showed last every half second, and erase the line at the end."""
        ended = threading.Event()

        def repeat() -> None:
            while not ended.wait(REPEATED_S):
                if self._last is not None:
                    self._draw(*self._last)

        thread = threading.Thread(target=repeat, daemon=True)
        thread.start()
        try:
            yield self.show
        finally:
            ended.set()
            thread.join()
            self.erase()

    def erase(self) -> None:
        """Erase the line."""
        if self._begun_s is not None:
            print(ERASE, end="", file=sys.stderr, flush=True)
