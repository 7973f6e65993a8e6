"""Text that a device or peer sent, made fit for a log line or a message."""

from __future__ import annotations

LONGEST = 500
"""Characters that are shown."""


def one_line(text: str) -> str:
    """Return the text on one line: control characters escaped, and cut where it is longer than `LONGEST`."""
    shown = text[:LONGEST]
    if not shown.isprintable():
        shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in shown)[:LONGEST]
    return shown if len(text) <= LONGEST else f"{shown} … ({len(text)} characters)"
