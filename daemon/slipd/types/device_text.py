"""Make text from a device or peer safe for a log line or a message."""

from __future__ import annotations

LONGEST = 500
"""Most characters that are shown."""


def printable(text: str) -> str:
    """Return the text on one line, with control characters escaped."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def printable_lines(text: str) -> str:
    """Return the text with control characters escaped, except line feeds."""
    return "\n".join(printable(line) for line in text.split("\n"))


def one_line(text: str) -> str:
    """Return the text on one line, with control characters escaped, cut to `LONGEST` characters."""
    shown = printable(text[:LONGEST])[:LONGEST]
    return shown if len(text) <= LONGEST else f"{shown} … ({len(text)} characters)"
