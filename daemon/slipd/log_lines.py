"""The filter of the log: lines are escaped, cut, and limited in number, because devices and peers can cause them."""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TextIO

from slipd.device_text import one_line

BURST = 10
"""Lines of one kind that pass at once."""

EVERY_S = 5.0
"""Interval after which one more line passes, s."""

KINDS = 256
"""Kinds of lines that are counted separately; beyond this number all counts are reset."""


_PRIORITIES = (logging.CRITICAL, 2), (logging.ERROR, 3), (logging.WARNING, 4), (logging.INFO, 6)
_DEBUG = 7


@dataclass(slots=True)
class _Kind:
    allowed: float
    at_s: float
    dropped: int = 0


class LogGate(logging.Filter):
    """Pass or drop each line; the next line of a kind states how many were dropped.

    Lines are of one kind if logger, message and first argument, such as the name of a link, are the same.

    Args:
        now: Monotonic clock, s.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._now = now
        self._kinds: dict[tuple[str, str, str], _Kind] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a line passes, after making its text safe."""
        try:
            line = one_line(record.getMessage())
        except (TypeError, ValueError, KeyError):  # its arguments do not fit, which the handler reports
            return True
        kind = self._kind(record)
        if kind.allowed < 1.0:
            kind.dropped += 1
            return False
        kind.allowed -= 1.0
        record.msg = f"{line} ({kind.dropped} similar lines were dropped)" if kind.dropped else line
        record.args = ()
        kind.dropped = 0
        return True

    def _kind(self, record: logging.LogRecord) -> _Kind:
        """Return the kind of a line, with its allowance updated."""
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


class JournalFormatter(logging.Formatter):
    """Begin every line with its priority, as the journal of systemd reads it: ``<4>slipd.transport.link: …``."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the lines of a record; those of a traceback are lines of their own."""
        mark = f"<{_priority(record.levelno)}>"
        return "\n".join(mark + line for line in super().format(record).splitlines())


def _priority(level: int) -> int:
    """Return the priority of syslog for a level."""
    return next((priority for least, priority in _PRIORITIES if level >= least), _DEBUG)


def is_journal(stream: TextIO, environment: Mapping[str, str]) -> bool:
    """Return whether a stream is read by the journal: ``JOURNAL_STREAM`` has its device and inode."""
    try:
        found = os.fstat(stream.fileno())
    except (OSError, ValueError):  # no file, as in tests
        return False
    return environment.get("JOURNAL_STREAM") == f"{found.st_dev}:{found.st_ino}"


def open_log() -> None:
    """Send the log to standard error, through the filter; with priorities where the journal reads it."""
    handler = logging.StreamHandler()
    plain = logging.Formatter("%(levelname)s %(name)s: %(message)s")
    handler.setFormatter(JournalFormatter("%(name)s: %(message)s") if is_journal(sys.stderr, os.environ) else plain)
    handler.addFilter(LogGate())
    logging.basicConfig(level=logging.INFO, handlers=[handler])
