"""The journal of systemd: entries with fields over its socket, or lines with priorities on standard error.

The protocol is one datagram of fields for each entry (https://systemd.io/JOURNAL_NATIVE_PROTOCOL). A binding of
libsystemd would be a dependency for twenty lines. Log calls give the fields in ``extra``: ``slipd_fault`` is an id of
``docs/health.md``; ``slipd_stream``, such as "left.wrench", also gives the finger.
"""

from __future__ import annotations

import logging
import os
import socket
import struct
from collections.abc import Iterator, Mapping
from typing import TextIO

from slipd.types.device_text import one_line

JOURNAL = "/run/systemd/journal/socket"

_FIELDS = ("slipd_fault", "slipd_stream", "slipd_recording")
"""Keys of ``extra``; the fields have the same names in upper case."""

_PRIORITIES = (logging.CRITICAL, 2), (logging.ERROR, 3), (logging.WARNING, 4), (logging.INFO, 6)
_DEBUG = 7


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
            text = self.format(record)
        except Exception:
            self.handleError(record)
            return
        try:
            self._socket.sendto(b"".join(_field(*field) for field in _fields(record, text)), self._address)
        except OSError:
            self._fallback.handle(record)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
        super().close()


def _fields(record: logging.LogRecord, text: str) -> Iterator[tuple[str, str]]:
    """Yield name and value of each field."""
    yield "MESSAGE", text
    yield "PRIORITY", str(_priority(record.levelno))
    yield "SYSLOG_IDENTIFIER", "slipd"
    yield "LOGGER", record.name
    yield "CODE_FILE", record.pathname
    yield "CODE_LINE", str(record.lineno)
    yield "CODE_FUNC", record.funcName or ""
    given = {key: str(getattr(record, key)) for key in _FIELDS if hasattr(record, key)}
    finger, dot, _ = given.get("slipd_stream", "").partition(".")
    if dot:
        given["slipd_finger"] = finger
    for key, value in given.items():
        yield key.upper(), one_line(value)


def _field(name: str, value: str) -> bytes:
    """Return a field as the journal reads it; a value of several lines is preceded by its length."""
    data = value.encode(errors="replace")
    if b"\n" not in data:
        return b"%s=%s\n" % (name.encode(), data)
    return b"%s\n%s%s\n" % (name.encode(), struct.pack("<Q", len(data)), data)


class PriorityFormatter(logging.Formatter):
    """Begin every line with its priority, as the journal reads it: ``<4>slipd.io.transport.link: …``.

    Args:
        inner: Formats the record.
    """

    def __init__(self, inner: logging.Formatter) -> None:
        super().__init__()
        self._inner = inner

    def format(self, record: logging.LogRecord) -> str:
        """Return the lines of a record; those of a traceback are lines of their own."""
        mark = f"<{_priority(record.levelno)}>"
        return "\n".join(mark + line for line in self._inner.format(record).splitlines())


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
