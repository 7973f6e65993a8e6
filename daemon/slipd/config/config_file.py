"""Read the config of a rig from its file, and report every fault with its line.

A file of ``config/`` describes one rig. An unknown key, a wrong type or a value out of range refuses the whole file,
and all faults are reported at once, each with its line, which tomllib does not report. A missing limit means that
nothing is moved, never that there is no limit.
"""

from __future__ import annotations

import contextlib
import difflib
import itertools
import json
import os
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from slipd.config.checks import semantic_faults
from slipd.config.model import TABLES, Config, table_model
from slipd.errors import ConfigError, ConfigFault
from slipd_client.paths import trust_faults, user_name

_TYPE_RULES = {
    "finite_number": "must be a finite number",
    "float_type": "must be a number",
    "int_type": "must be an integer",
    "bool_type": "must be true or false",
    "string_type": "must be a text in quotes",
    "list_type": "must be a list",
    "dict_type": "must be a table",
    "model_type": "must be a table",
    "string_too_short": "must not be empty",
}
"""Type of a fault that pydantic finds → rule."""

_BOUND_RULES = {
    "greater_than": ("be above", "gt", ""),
    "greater_than_equal": ("be at least", "ge", ""),
    "less_than": ("be below", "lt", ""),
    "less_than_equal": ("be at most", "le", ""),
    "too_short": ("have at least", "min_length", " values"),
    "too_long": ("have at most", "max_length", " values"),
}
"""Type of a fault that pydantic finds → relation, name of the bound, unit."""

_PART = re.compile(r"""[A-Za-z0-9_-]+|"[^"]*"|'[^']*'""")
_DOTTED = rf"((?:{_PART.pattern})(?:\s*\.\s*(?:{_PART.pattern}))*)"
_TABLE = re.compile(rf"^\s*\[\[?\s*{_DOTTED}\s*\]\]?\s*(#.*)?$")  # a row of numbers in a list does not match
_KEY = re.compile(rf"^\s*{_DOTTED}\s*=")
_MARKED = re.compile(r"=.*#.*\bMEASURE\b")

_DECIMAL_COMMA = re.compile(r"^\s*([A-Za-z0-9_-]+)\s*=\s*([-+]?\d+),(\d+)\s*(?:#.*)?$")

_SLIPS_OF_THE_PEN = (
    (re.compile(r"[\u2018-\u201e]"), 'quotes must be straight: "'),
    (re.compile(r"^\s*[A-Za-z0-9_-]+\s*:"), 'a key and its value must be joined by "=", not ":"'),
    (re.compile(r"""=\s*("[^"]*|'[^']*)$"""), "the closing quote is missing"),
)
"""What a line that is not TOML looks like, and what is wrong with it."""

ENCODING = "utf-8-sig"
"""UTF-8; the byte-order mark that some editors write first is left out."""

MOST_BYTES = 1_000_000
"""Largest file that is read; a rig of two pads with 4096 three-axis taxels has a tenth of it in tares."""

NO_FINGER = "is missing: each finger needs a table [finger.NAME]; `slipd config show demo` prints an example"


def load(path: Path) -> Config:
    """Read a config file that no other user may change (see `slipd_client.paths`).

    Raises:
        ConfigError: The file cannot be read, other users may change it, or it has faults; the error lists them all.
    """
    try:
        with path.open("rb") as file:  # read_text would turn CRLF into LF
            data = file.read(MOST_BYTES + 1)
        untrusted = trust_faults(path)
    except OSError as error:
        raise ConfigError(str(path), [ConfigFault("", None, f"cannot be read: {_reason(error, path)}")]) from None
    if len(data) > MOST_BYTES:
        untrusted.append(f"must have at most {MOST_BYTES} bytes: is it a config?")
    if untrusted:
        raise ConfigError(str(path), [ConfigFault("", None, fault) for fault in untrusted])
    try:
        text = data.decode(ENCODING)
    except UnicodeDecodeError as error:
        at = data.count(b"\n", 0, error.start) + 1
        raise ConfigError(str(path), [ConfigFault("", at, "cannot be read: it is not UTF-8 text")]) from None
    return parse(text, str(path))


def _reason(error: OSError, path: Path) -> str:
    if isinstance(error, FileNotFoundError) and path.name == str(path) and not path.suffix:
        return f"{error.strerror}; to copy a shipped config: slipd config show {path} > {path}.toml"
    if isinstance(error, PermissionError):
        return f"{error.strerror} for user {user_name(os.geteuid())}; run chmod a+r on it, and a+x on its folders"
    return str(error.strerror)


def parse(text: str, file: str) -> Config:
    """Parse the text of a config.

    Args:
        text: The text, TOML.
        file: Name of the file, for errors.

    Raises:
        ConfigError: The text has faults; the error lists them all.
    """
    try:
        tree = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # not only TOMLDecodeError: a number or list may be too long or deep
        raise ConfigError(file, [ConfigFault("", *syntax_fault(text, error))]) from None
    config, found = None, []
    try:
        config = Config.model_validate(tree)
    except ValidationError as error:
        faults = error.errors(include_url=False)
        found = [explain(fault) for fault in faults]
        for fault in faults:
            _remove_value(tree, fault["loc"])
        with contextlib.suppress(ValidationError):  # the valid values may still not fit each other
            config = Config.model_validate(tree)
    if config is not None:
        found += [(tuple(path.split(".")), message) for path, message in semantic_faults(config)]
    if config is None or found:
        lines = key_lines(text)
        raise ConfigError(file, [ConfigFault(".".join(path), line_of(lines, path), fault) for path, fault in found])
    return config.with_text(text)


def _remove_value(tree: Any, location: tuple[int | str, ...]) -> None:
    """Remove a faulty value, so that its default applies; a faulty value in a list removes the whole list."""
    for depth, key in enumerate(location):
        if not isinstance(tree, dict) or key not in tree:
            return
        last = depth == len(location) - 1 or not isinstance(tree[key], dict)
        if last:
            del tree[key]
            return
        tree = tree[key]


def explain(fault: Any) -> tuple[tuple[str, ...], str]:
    """Return key path and text of a fault, which is an entry of ``ValidationError.errors()``."""
    path = tuple(str(part) for part in fault["loc"])
    if fault["type"] == "extra_forbidden":
        return path, f"unknown key; {_hint(path)}"
    if path == ("finger",) and fault["type"] in ("missing", "too_short"):
        return path, NO_FINGER
    if fault["type"] == "missing":
        return path, "is missing"
    if fault["type"] == "value_error":  # one of our own, whose text is complete
        return path, str(fault["ctx"]["error"])
    rule = _rule(fault["type"], fault.get("ctx", {})) or str(fault["msg"]).replace("Input should", "must")
    return path, f"{rule[0].lower()}{rule[1:]}, got {_as_written(fault['input'])}"


def _as_written(value: Any) -> str:
    """Return a value as TOML writes it: ``true``, and not ``True``."""
    return repr(value) if isinstance(value, (str, float)) else json.dumps(value, default=str, ensure_ascii=False)


def _rule(kind: str, context: Mapping[str, Any]) -> str:
    """Return the rule behind a fault that pydantic finds, by its type; "" if pydantic's own text will do."""
    if kind in _BOUND_RULES:
        relation, key, what = _BOUND_RULES[kind]
        return f"must {relation} {context[key]:.15g}{what}"
    if kind == "string_pattern_mismatch":
        what = "an absolute path" if context["pattern"].startswith("^/") else "a text"
        return f"must be {what} without control characters"
    return _TYPE_RULES.get(kind, "")


def _hint(path: tuple[str, ...]) -> str:
    """Return what was probably meant by an unknown key: the table that has it, a similar key, or any key beside it."""
    if tables := _tables_with(path):
        return f"it belongs in {' or '.join(f'[{table}]' for table in tables)}"
    known = sorted((table_model(path[:-1]) or Config).model_fields)
    near = difflib.get_close_matches(path[-1], known, n=1)
    return f"did you mean {near[0]!r}?" if near else f"known here: {', '.join(known)}"


def _tables_with(path: tuple[str, ...]) -> list[str]:
    """Return the tables nearest to that of a key path which have its key; [] if none has it."""
    *table, key = path
    found: dict[str, int] = {}
    for name, model in TABLES.items():
        if key in model.model_fields:
            parts = name.split(".")
            same = (part in ("X", key) for part, key in zip(parts, table, strict=False))
            shared = sum(itertools.takewhile(bool, same))
            found[".".join([*table[:shared], *parts[shared:]]).replace("X", "NAME")] = shared
    return [name for name, shared in found.items() if shared == max(found.values())]


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
    line = lines_of(text)[at - 1]
    if match := _DECIMAL_COMMA.match(line):
        key, whole, part = match.groups()
        return at, f"{key} must be written with a decimal point, got {whole},{part}: write {key} = {whole}.{part}"
    for looks, wrong in _SLIPS_OF_THE_PEN:
        if looks.search(line.partition("#")[0]):
            return at, f"not TOML: {wrong}"
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
    """Return the line of a key; where the file lacks it, that of the innermost table around it, or None."""
    return next((lines[path[:depth]] for depth in range(len(path), 0, -1) if path[:depth] in lines), None)


def _parts(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip("\"'") for part in _PART.findall(dotted))
