"""Properties of an output stream: whether it is a screen, its size, colours, and characters beyond ASCII."""

from __future__ import annotations

import os
from typing import TextIO

from slipd_client.live_view import UNCUT, Terminal

DEFAULT_SIZE = os.terminal_size((80, 24))
"""Of a serial console, which reports 0."""


def is_screen(stream: TextIO) -> bool:
    """Return whether a stream is a terminal with a movable cursor."""
    return stream.isatty() and not _dumb()


def terminal_of(stream: TextIO, columns: int, lines: int) -> Terminal:
    """Return what to draw for, given the room that there is."""
    colour = is_screen(stream) and not os.environ.get("NO_COLOR")
    return Terminal(columns, lines, colour, ascii_only(stream))


def size_of(stream: TextIO) -> os.terminal_size:
    """Return the size of a terminal; any other stream has room for everything."""
    if not stream.isatty():
        return os.terminal_size((UNCUT, UNCUT))
    size = os.get_terminal_size(stream.fileno())
    return size if size.columns and size.lines else DEFAULT_SIZE


def ascii_only(stream: TextIO) -> bool:
    """Return whether a stream can take ASCII only: it is not UTF-8, or the locale is not.

    Where LANG is C or missing, Python itself sets LC_CTYPE to C.UTF-8, which does not describe the terminal.
    """
    if stream.encoding.lower().replace("-", "") != "utf8":
        return True
    by_hand = os.environ.get("LC_CTYPE", "").replace("C.UTF-8", "")
    locale = os.environ.get("LC_ALL") or by_hand or os.environ.get("LANG") or "C"
    return "utf8" not in locale.lower().replace("-", "")


def _dumb() -> bool:
    """Return whether the terminal knows no escape sequences, by TERM."""
    return os.environ.get("TERM") == "dumb"
