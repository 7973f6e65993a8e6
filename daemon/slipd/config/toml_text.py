"""The text of a config: the line of each key, for error messages, and a key that is set while the rest stays.

tomllib reports no lines, and does not write.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator

_PART = re.compile(r"""[A-Za-z0-9_-]+|"[^"]*"|'[^']*'""")
_DOTTED = rf"((?:{_PART.pattern})(?:\s*\.\s*(?:{_PART.pattern}))*)"
_TABLE = re.compile(rf"^\s*\[\[?\s*{_DOTTED}\s*\]\]?\s*(#.*)?$")  # a row of numbers in a list does not match
_KEY = re.compile(rf"^\s*{_DOTTED}\s*=")
_MARKED = re.compile(r"=.*#.*\bMEASURE\b")
PER_LINE = 12
"""Most numbers in a line."""

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


def with_numbers(text: str, path: tuple[str, ...], numbers: list[float], comment: str) -> str:
    """Return a config with one key set to a list of numbers.

    The key is replaced where it is, together with the comment lines right above it, which describe its old value. A
    missing key is added below the header of its table.

    Args:
        text: The config, valid TOML.
        path: Tables and name of the key.
        numbers: Its new value.
        comment: What the numbers are, one line.

    Raises:
        ValueError: The table has no header line, so that the key cannot be placed.
    """
    lines = lines_of(text)
    first, after, name = _place(lines, text, path)
    while after > first > 0 and lines[first - 1].lstrip().startswith("#"):
        first -= 1
    rows = [", ".join(map(repr, numbers[at : at + PER_LINE])) for at in range(0, len(numbers), PER_LINE)]
    value = [f"# {comment}", f"{name} = [", *(f"    {row}," for row in rows), "]"]
    return _joined(lines[:first], value, lines[after:])


def with_value(text: str, path: tuple[str, ...], value: str, comment: str) -> str:
    """Return a config with one key set to a value in one line.

    Args:
        text: The config, valid TOML.
        path: Tables and name of the key.
        value: Its new value, as TOML.
        comment: Where the value comes from; it replaces the comment behind the old value.

    Raises:
        ValueError: The table has no header line, so that the key cannot be placed.
    """
    lines = lines_of(text)
    first, after, name = _place(lines, text, path)
    return _joined(lines[:first], [f"{name} = {value}  # {comment}"], lines[after:])


def _place(lines: list[str], text: str, path: tuple[str, ...]) -> tuple[int, int, str]:
    """Return the first line of a key, the line after it, and the key as written; a missing key has no lines."""
    found = key_lines(text)
    header = found.get(path[:-1])
    if path in found and not lines[found[path] - 1].lstrip().startswith("["):
        first = found[path] - 1
        after = next(end for end in range(first + 1, len(lines) + 1) if _is_toml("\n".join([*lines[first:end], ""])))
        return first, after, lines[first].split("=")[0].strip()
    if header is not None and path not in found and lines[header - 1].lstrip().startswith("["):
        return header, header, path[-1]
    raise ValueError(f"must have a line [{'.'.join(path[:-1])}], to set {path[-1]} below it")


def _joined(before: list[str], new: list[str], after: list[str]) -> str:
    """Return the text with new lines, which end as the others do."""
    end = "\r" if any(line.endswith("\r") for line in (before + after)[:1]) else ""
    return "\n".join([*before, *(line + end for line in new), *(after or [""])])


def _is_toml(text: str) -> bool:
    try:
        tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return False
    return True
