"""The log: lines are escaped, cut, and limited in number, because devices and peers can cause them.

It goes to standard error, or as entries with fields to the socket of the journal of systemd: one datagram for each
entry (https://systemd.io/JOURNAL_NATIVE_PROTOCOL). A binding of libsystemd would be a dependency for twenty lines. Log
calls give the fields in ``extra``: ``slipd_fault`` is an id of ``docs/health.md``; ``slipd_stream``, such as
"left.wrench", also gives the finger.
"""

from __future__ import annotations

import logging
import os
import socket
import struct
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from logging.handlers import RotatingFileHandler, SysLogHandler
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

from slipd.errors import one_line
from slipd.io.rate_limit import RateLimit

BURST = 10
"""Lines of one kind that pass at once."""

EVERY_S = 5.0
"""Interval after which one more line passes, s."""

KINDS = 256
"""Kinds of lines that are counted separately; of more, the kind that was silent for longest is forgotten."""

KEPT_BYTES = 1_000_000
"""Length of a file of the log, after which the next begins."""

JOURNAL = "/run/systemd/journal/socket"

_FIELDS = ("slipd_fault", "slipd_stream", "slipd_recording")
"""Keys of ``extra``; the fields have the same names in upper case."""

_log = logging.getLogger(__name__)


class LogGate(logging.Filter):
    """Pass or drop each line; the next line of a kind states how many were dropped.

    Lines are of one kind if logger, message and first argument, such as the name of a link, are the same.

    Args:
        now: Monotonic clock, s.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._now = now
        self._limit = RateLimit(1.0 / EVERY_S, BURST, KINDS)
        self._dropped: Counter[tuple[str, str, str]] = Counter()

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a line passes, after making its text safe."""
        try:
            line = one_line(record.getMessage())
        except (TypeError, ValueError, KeyError):  # its arguments do not fit, which the handler reports
            return True
        first = record.args[0] if isinstance(record.args, tuple) and record.args else ""
        kind = record.name, str(record.msg), str(first)
        if not self._limit.allows(kind, round(self._now() * 1e9)):
            if len(self._dropped) > KINDS:
                self._dropped.clear()
            self._dropped[kind] += 1
            return False
        dropped = self._dropped.pop(kind, 0)
        record.msg = f"{line} ({dropped} similar lines were dropped)" if dropped else line
        record.args = ()
        return True


class LogFormatter(logging.Formatter):
    """Escape and indent tracebacks: no text of an exception can look like a line of the log."""

    def formatException(self, ei: Any) -> str:  # noqa: N802 - named by logging
        """Return the traceback of an exception."""
        return "\n".join(f"  {one_line(line)}" for line in super().formatException(ei).split("\n"))


def log_uncaught() -> None:
    """Send the traceback of an exception that ends the process, or a thread, to the log."""
    sys.excepthook = _log_uncaught
    threading.excepthook = lambda fault: _log_uncaught(fault.exc_type, fault.exc_value, fault.exc_traceback)


def _log_uncaught(kind: type[BaseException], error: BaseException | None, trace: TracebackType | None) -> None:
    _log.critical("ended by an unexpected exception", exc_info=(kind, error or kind(), trace))


class TerminalHandler(logging.StreamHandler):  # type: ignore[type-arg]
    """Write the log to standard error, and a copy of every line that passes to a file, where one is kept."""

    copy: logging.Handler | None = None

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record."""
        super().emit(record)
        if self.copy is not None:
            self.copy.handle(record)


class JournalHandler(logging.Handler):
    """Send each record as one entry of the journal, without blocking.

    Args:
        address: Socket of the journal.
        fallback: Takes the records that the journal does not: it is gone, busy, or they are too long for a datagram.
    """

    def __init__(self, address: str, fallback: logging.Handler) -> None:
        super().__init__()
        self._address, self._fallback = address, fallback
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def emit(self, record: logging.LogRecord) -> None:
        """Send a record."""
        try:
            fields = _fields(record, self.format(record))
            self._socket.sendto(b"".join(_field(*field) for field in fields.items()), self._address)
        except OSError:
            self._fallback.handle(record)
        except Exception:
            self.handleError(record)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
        super().close()


def _fields(record: logging.LogRecord, text: str) -> dict[str, str]:
    """Return the fields of an entry."""
    fields = {
        "MESSAGE": text,
        "PRIORITY": str(_priority(record)),
        "SYSLOG_IDENTIFIER": "slipd",
        "LOGGER": record.name,
        "CODE_FILE": record.pathname,
        "CODE_LINE": str(record.lineno),
        "CODE_FUNC": record.funcName or "",
    }
    fields |= {key.upper(): one_line(str(getattr(record, key))) for key in _FIELDS if hasattr(record, key)}
    finger, dot, _ = fields.get("SLIPD_STREAM", "").partition(".")
    return fields | ({"SLIPD_FINGER": finger} if dot else {})


def _field(name: str, value: str) -> bytes:
    """Return a field as the journal reads it; a value of several lines is preceded by its length."""
    data = value.encode(errors="replace")
    if b"\n" not in data:
        return b"%s=%s\n" % (name.encode(), data)
    return b"%s\n%s%s\n" % (name.encode(), struct.pack("<Q", len(data)), data)


class PriorityFormatter(LogFormatter):
    """Begin every line with its priority, as the journal reads it: ``<4>slipd.io.transport.link: …``."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the lines of a record; those of a traceback are lines of their own."""
        mark = f"<{_priority(record)}>"
        return "\n".join(mark + line for line in super().format(record).splitlines())


def _priority(record: logging.LogRecord) -> int:
    """Return the priority of a record, as syslog numbers it."""
    return SysLogHandler.priority_names[SysLogHandler.priority_map.get(record.levelname, "debug")]


def is_journal(stream: TextIO, environment: Mapping[str, str]) -> bool:
    """Return whether a stream is read by the journal: ``JOURNAL_STREAM`` has its device and inode."""
    try:
        found = os.fstat(stream.fileno())
    except (OSError, ValueError):  # no file, as in tests
        return False
    return environment.get("JOURNAL_STREAM") == f"{found.st_dev}:{found.st_ino}"


@contextmanager
def log_kept(path: Path) -> Iterator[None]:
    """Keep the log in a file too, for ``slipctl diagnose``; not where the journal keeps it, or this program has no log.

    Args:
        path: The file, in a folder that only this user may change; it grows up to ``KEPT_BYTES``, with one before it.
    """
    terminals = [each for each in logging.getLogger().handlers if isinstance(each, TerminalHandler)]
    with ExitStack() as stack:
        for terminal in terminals:
            try:
                file = RotatingFileHandler(path, maxBytes=KEPT_BYTES, backupCount=1, encoding="utf-8")
            except OSError as error:
                _log.warning("%s: the log is not kept: %s", path, error.strerror)
                continue
            file.setFormatter(LogFormatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
            terminal.copy = stack.enter_context(closing(file))
            stack.callback(setattr, terminal, "copy", None)
        yield


def open_log(environment: Mapping[str, str] = os.environ, journal: str = JOURNAL) -> None:
    """Send the log to standard error, through the filter; to the journal, with fields, where it reads standard error.

    Args:
        environment: Has ``JOURNAL_STREAM`` where systemd started this process.
        journal: Socket of the journal.
    """
    handler: logging.Handler = TerminalHandler()
    if is_journal(sys.stderr, environment):
        handler.setFormatter(PriorityFormatter("%(name)s: %(message)s"))
        handler = JournalHandler(journal, handler)
        handler.setFormatter(LogFormatter("%(name)s: %(message)s"))
    else:
        handler.setFormatter(LogFormatter("%(levelname)s %(name)s: %(message)s"))
    handler.addFilter(LogGate())
    logging.basicConfig(level=logging.INFO, handlers=[handler])
