"""Read the config of a rig from its file, and report every fault with its line.

A file of ``config/`` describes one rig. An unknown key, a wrong type or a value out of range refuses the whole file,
and all faults are reported at once. A missing limit means that nothing is moved, never that there is no limit.
"""

from __future__ import annotations

import contextlib
import difflib
import os
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from slipd.config.checks import semantic_faults
from slipd.config.model import Config, table_model
from slipd.config.toml_text import key_lines, line_of, syntax_fault
from slipd.errors import ConfigError, ConfigFault, UsageError
from slipd_client.path_trust import trust_faults, user_name

_TYPE_RULES = {
    "finite_number": "must be a finite number",
    "float_type": "must be a number",
    "int_type": "must be an integer",
    "bool_type": "must be true or false",
    "string_type": "must be a text in quotes",
    "list_type": "must be a list",
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
_PACKAGE = Path(__file__).parents[1] / "shipped"
ROOT = _PACKAGE if _PACKAGE.is_dir() else Path(__file__).parents[3]
"""The folder of README.md, ``config/`` and ``docs/``."""
CONFIGS, DOCS = ROOT / "config", ROOT / "docs"


def load(path: Path) -> Config:
    """Read a config file that no other user may change (see `slipd_client.path_trust`).

    Raises:
        ConfigError: The file cannot be read, other users may change it, or it has faults; the error lists them all.
    """
    try:
        text = path.read_bytes().decode()  # read_text would turn CRLF into LF
        untrusted = trust_faults(path)
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(str(path), [ConfigFault("", None, f"cannot be read: {_reason(error)}")]) from None
    if untrusted:
        raise ConfigError(str(path), [ConfigFault("", None, fault) for fault in untrusted])
    return parse(text, str(path))


def _reason(error: OSError | UnicodeDecodeError) -> str:
    if isinstance(error, PermissionError):
        return f"{error.strerror} for user {user_name(os.geteuid())}; run chmod a+r on it, and a+x on its folders"
    return str(error.strerror) if isinstance(error, OSError) else "it is not UTF-8 text"


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
    try:
        config = Config.model_validate(tree)
    except ValidationError as error:
        errors = error.errors(include_url=False)
        found = [explain(fault) for fault in errors]
        for fault in errors:
            _remove_value(tree, fault["loc"])
        with contextlib.suppress(ValidationError):  # the valid values may still not fit each other
            found += _semantic_faults(Config.model_validate(tree))
        raise _config_error(file, text, found) from None
    if faults := _semantic_faults(config):
        raise _config_error(file, text, faults)
    return config.with_text(text)


def _semantic_faults(config: Config) -> list[tuple[tuple[str, ...], str]]:
    return [(tuple(path.split(".")), message) for path, message in semantic_faults(config)]


def _config_error(file: str, text: str, found: list[tuple[tuple[str, ...], str]]) -> ConfigError:
    lines = key_lines(text)
    return ConfigError(file, [ConfigFault(".".join(path), line_of(lines, path), message) for path, message in found])


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
        known = _keys_beside(path)
        near = difflib.get_close_matches(path[-1], known, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"known here: {', '.join(known)}"
        return path, f"unknown key; {hint}"
    if fault["type"] == "missing":
        return path, "is missing"
    if fault["type"] == "value_error":  # one of our own, whose text is complete
        return path, str(fault["ctx"]["error"])
    rule = _rule(fault["type"], fault.get("ctx", {})) or str(fault["msg"]).replace("Input should", "must")
    return path, f"{rule[0].lower()}{rule[1:]}, got {fault['input']!r}"


def _rule(kind: str, context: Mapping[str, Any]) -> str:
    """Return the rule behind a fault that pydantic finds, by its type; "" if pydantic's own text will do."""
    if kind in _BOUND_RULES:
        relation, key, what = _BOUND_RULES[kind]
        return f"must {relation} {context[key]:.15g}{what}"
    if kind == "string_pattern_mismatch":
        what = "an absolute path" if context["pattern"].startswith("^/") else "a text"
        return f"must be {what} without control characters"
    return _TYPE_RULES.get(kind, "")


def _keys_beside(path: tuple[str, ...]) -> list[str]:
    """Return the keys that the table of ``path`` may hold."""
    return sorted((table_model(path[:-1]) or Config).model_fields)


def config_file(name: str) -> Path:
    """Return a config of ``config/``; ``.toml`` may be left out.

    Raises:
        UsageError: There is no such config; the text names the nearest one.
    """
    if name in {path.name for path in system_files()}:
        raise UsageError(f"{name} is no config of a rig; print it with: slipd service show {name}")
    return _named("config", name, {path.name: path for path in config_files()}, ".toml")


def config_files() -> list[Path]:
    """Return the configs of ``config/``."""
    return sorted(CONFIGS.rglob("*.toml"))


def system_file(name: str) -> Path:
    """Return a file for systemd or udev.

    Raises:
        UsageError: There is no such file; the text names the nearest one.
    """
    return _named("file", name, {path.name: path for path in system_files()}, ".service")


def system_files() -> list[Path]:
    """Return the files of ``config/`` for systemd and udev."""
    return sorted(path for path in CONFIGS.rglob("*") if path.is_file() and path.suffix != ".toml")


def page_file(name: str) -> Path:
    """Return a page of the docs by its name in `pages`; ``.md`` may be left out.

    Raises:
        UsageError: There is no such page; the text names the nearest one.
    """
    return _named("page", name.removeprefix("docs/"), pages(), ".md")


def pages() -> dict[str, Path]:
    """Return the pages of the docs by name, such as "physics" or "measured/peers"; README comes first."""
    found = [path.relative_to(DOCS) for path in DOCS.rglob("*.md")]
    ordered = sorted(found, key=lambda path: (len(path.parts), path))
    return {"README": ROOT / "README.md"} | {path.with_suffix("").as_posix(): DOCS / path for path in ordered}


def _named(kind: str, name: str, files: dict[str, Path], suffix: str) -> Path:
    for known in (name, name + suffix, name.removesuffix(suffix)):
        if known in files:
            return files[known]
    raise UsageError(f"there is no {kind} {name!r}; {_nearest(name, [key.removesuffix(suffix) for key in files])}")


def _nearest(name: str, known: Iterable[str]) -> str:
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1)
    return f"did you mean {near[0]!r}?" if near else f"known: {', '.join(names)}"
