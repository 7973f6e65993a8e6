"""Find the line of each key of a TOML file, for error messages; tomllib does not report lines."""

from __future__ import annotations

import re

_PART = re.compile(r"""[A-Za-z0-9_-]+|"[^"]*"|'[^']*'""")
_DOTTED = rf"((?:{_PART.pattern})(?:\s*\.\s*(?:{_PART.pattern}))*)"
_TABLE = re.compile(rf"^\s*\[\[?\s*{_DOTTED}\s*\]\]?\s*(#.*)?$")  # a row of numbers in a list does not match
_KEY = re.compile(rf"^\s*{_DOTTED}\s*=")


def key_lines(text: str) -> dict[tuple[str, ...], int]:
    """Return the line, 1-based, of every table and key that starts a line."""
    lines: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    for number, line in enumerate(text.splitlines(), start=1):
        if match := _TABLE.match(line):
            table = _parts(match[1])
            lines.setdefault(table, number)
        elif match := _KEY.match(line):
            lines.setdefault(table + _parts(match[1]), number)
    return lines


def line_of(lines: dict[tuple[str, ...], int], path: tuple[str, ...]) -> int | None:
    """Return the line of a key, or of the innermost enclosing table that is in the file; None if there is none."""
    while path:
        if path in lines:
            return lines[path]
        path = path[:-1]
    return None


def _parts(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip("\"'") for part in _PART.findall(dotted))
