"""The exceptions that slipd raises, and what makes the text of a device or peer safe to show.

    SlipdError
    ├── ConfigError      a config that cannot be run; lists every fault with its line
    ├── UsageError       a call that cannot be carried out as it is written
    ├── LinkError        a port, socket or server that cannot be opened
    └── RecordingError   a recording that cannot be written or read

Invalid data of a sensor is never an exception: it is counted and reported as a status.
An invalid call (wrong shape, impossible argument) raises ValueError.
"""

from __future__ import annotations

from dataclasses import dataclass


class SlipdError(Exception):
    """Base of all; the text states where the fault is, what was found, and the rule."""


@dataclass(frozen=True, slots=True)
class ConfigFault:
    """One fault of a config file.

    Attributes:
        path: Dotted key path, e.g. ``finger.left.pad.rows``.
        line: Line in the file, 1-based; None if the key is not in the file.
        message: The rule, and what was found.
    """

    path: str
    line: int | None
    message: str


class ConfigError(SlipdError):
    """A config that cannot be run; its text has a line for each fault, with control characters escaped.

    Args:
        file: Name of the file.
        faults: All faults.
    """

    def __init__(self, file: str, faults: list[ConfigFault]) -> None:
        self.file = file
        self.faults = faults
        super().__init__("\n".join(self._line(fault) for fault in faults))

    def _line(self, fault: ConfigFault) -> str:
        place = self.file if fault.line is None else f"{self.file}:{fault.line}"
        return printable(f"{place}: {fault.path}: {fault.message}" if fault.path else f"{place}: {fault.message}")


class UsageError(SlipdError):
    """A call that cannot be carried out as it is written: a name, a pair of options, a place, or an extra is wrong."""


class LinkError(SlipdError):
    """A port, socket or server that cannot be opened."""


class RecordingError(SlipdError):
    """A recording that cannot be written or read."""


LONGEST_TEXT = 500
"""Most characters of a text that `one_line` keeps."""


def printable(text: str) -> str:
    """Return the text on one line, with control characters escaped."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def printable_lines(text: str) -> str:
    """Return the text with control characters escaped, except line feeds."""
    return "\n".join(printable(line) for line in text.split("\n"))


def one_line(text: str) -> str:
    """Return the text on one line, with control characters escaped, cut to `LONGEST_TEXT` characters."""
    shown = printable(text[:LONGEST_TEXT])[:LONGEST_TEXT]
    return shown if len(text) <= LONGEST_TEXT else f"{shown} … ({len(text)} characters)"
