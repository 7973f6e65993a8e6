"""The one gate of the log: lines that devices and peers cause are escaped, cut, and limited in number."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass

from slipd.device_text import one_line

BURST = 10
"""Lines of one kind that may pass at once."""

EVERY_S = 5.0
"""Interval at which one more may pass after them, s."""

KINDS = 256
"""Kinds of lines that are counted apart; beyond that number all counts begin again."""


@dataclass(slots=True)
class _Kind:
    allowed: float
    at_s: float
    left_out: int = 0


class LogGate(logging.Filter):
    """Lets a line pass, or leaves it out; lines left out are counted in the next one of their kind.

    Lines are of one kind when they come from one logger with one message and one first argument, such as a link's name.

    Args:
        now: Monotonic clock, s.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._now = now
        self._kinds: dict[tuple[str, str, str], _Kind] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a line may pass; rewrite it on the way."""
        try:
            line = one_line(record.getMessage())
        except (TypeError, ValueError, KeyError):  # its arguments do not fit: the handler reports where
            return True
        kind = self._kind(record)
        if kind.allowed < 1.0:
            kind.left_out += 1
            return False
        kind.allowed -= 1.0
        record.msg = f"{line} ({kind.left_out} such lines were left out)" if kind.left_out else line
        record.args = ()
        kind.left_out = 0
        return True

    def _kind(self, record: logging.LogRecord) -> _Kind:
        """Return the kind of a line, with its present allowance."""
        first = record.args[0] if isinstance(record.args, tuple) and record.args else ""
        key = record.name, str(record.msg), str(first)
        now_s = self._now()
        if key not in self._kinds:
            if len(self._kinds) >= KINDS:
                self._kinds.clear()
            self._kinds[key] = _Kind(BURST, now_s)
        kind = self._kinds[key]
        kind.allowed = min(BURST, kind.allowed + (now_s - kind.at_s) / EVERY_S)
        kind.at_s = now_s
        return kind


def open_log() -> None:
    """Send the log to standard error, through the gate."""
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(levelname)s %(name)s: %(message)s"))
    handler.addFilter(LogGate())
    logging.basicConfig(level=logging.INFO, handlers=[handler])
