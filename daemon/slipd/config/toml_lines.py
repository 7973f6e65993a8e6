"""Find the line of each key of a TOML file, for error messages; tomllib does not report lines."""

from __future__ import annotations

import re
from collections.abc import Iterator

_PART = re.compile(r"""[A-Za-z0-9_-]+|"[^"]*"|'[^']*'""")
_DOTTED = rf"((?:{_PART.pattern})(?:\s*\.\s*(?:{_PART.pattern}))*)"
_TABLE = re.compile(rf"^\s*\[\[?\s*{_DOTTED}\s*\]\]?\s*(#.*)?$")  # a row of numbers in a list does not match
_KEY = re.compile(rf"^\s*{_DOTTED}\s*=")
_MARKED = re.compile(r"=.*#.*\bMEASURE\b")
_DECIMAL_COMMA = re.compile(r"^\s*([A-Za-z0-9_-]+)\s*=\s*([-+]?\d+),(\d+)\s*(?:#.*)?$")


def lines_of(text: str) -> list[str]:
    """Return the lines as TOML divides them, at LF alone. A CR stays at the end; a final LF begins an empty line."""
    return text.split("\n")


def key_lines(text: str) -> dict[tuple[str, ...], int]:
    """Return the line, 1-based, of every table and key that starts a line."""
    lines: dict[tuple[str, ...], int] = {}
    for path, number in _headed(text):
        lines.setdefault(path, number)
    return lines


def marked_keys(text: str) -> dict[tuple[str, ...], int]:
    """Return the line of every key whose comment holds the word MEASURE: its value is still an example."""
    lines = lines_of(text)
    return {path: number for path, number in key_lines(text).items() if _MARKED.search(lines[number - 1])}


def syntax_fault(text: str, error: Exception) -> tuple[int | None, str]:
    """Return the line of an error of tomllib, and what is wrong there in words for the author of a config."""
    where = re.search(r"\(at line (\d+)", str(error))
    if where is None:
        return None, f"not TOML: {error}"
    at = int(where[1])
    if match := _DECIMAL_COMMA.match(lines_of(text)[at - 1]):
        key, whole, part = match.groups()
        return at, f"{key} must be written with a decimal point, got {whole},{part}: write {key} = {whole}.{part}"
    if str(error).startswith(("Cannot overwrite", "Cannot declare")):
        seen: dict[tuple[str, ...], int] = {}
        for path, number in _headed(text):
            if path in seen and number <= at:
                return number, f"{'.'.join(path)} is written twice, first in line {seen[path]}; keep one of them"
            seen.setdefault(path, number)
    return at, f"not TOML: {error}"


def _headed(text: str) -> Iterator[tuple[tuple[str, ...], int]]:
    """Yield the path and the line of every table and key that starts a line."""
    table: tuple[str, ...] = ()
    for number, line in enumerate(lines_of(text), start=1):
        if match := _TABLE.match(line):
            table = _parts(match[1])
            yield table, number
        elif match := _KEY.match(line):
            yield table + _parts(match[1]), number


def line_of(lines: dict[tuple[str, ...], int], path: tuple[str, ...]) -> int | None:
    """Return the line of a key, or of the innermost enclosing table that is in the file; None if there is none."""
    while path:
        if path in lines:
            return lines[path]
        path = path[:-1]
    return None


def _parts(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip("\"'") for part in _PART.findall(dotted))
