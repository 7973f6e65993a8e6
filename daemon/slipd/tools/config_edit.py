"""Set one key in the text of a config, while the rest stays: tomllib does not write."""

from __future__ import annotations

import tomllib

from slipd.config.config_file import key_lines, lines_of

PER_LINE = 12
"""Most numbers in a line."""


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
