"""Make text from a device or peer safe for a log line or a message."""

from __future__ import annotations

LONGEST = 500
"""Most characters that are shown."""


def one_line(text: str) -> str:
    """Return the text on one line, with control characters escaped, cut to `LONGEST` characters."""
    shown = text[:LONGEST]
    if not shown.isprintable():
        shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in shown)[:LONGEST]
    return shown if len(text) <= LONGEST else f"{shown} … ({len(text)} characters)"
