"""The config of a rig: read from its file, with every fault told at its place.

A file of ``config/`` describes one rig. An unknown key, a wrong type or a value out of range refuses the whole file,
and all faults are told at once. A limit that is not given means no actuation, never no limit.
"""

from __future__ import annotations

import contextlib
import difflib
import re
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from slipd.config.checks import meaning_faults
from slipd.config.model import (
    Bus,
    Config,
    Finger,
    Grasp,
    Gripper,
    Levels,
    Pad,
    PadPlace,
    Pose,
    Rates,
    Recording,
    Reflex,
    Requests,
    Slip,
    Wrench,
)
from slipd.config.path_trust import trust_faults
from slipd.config.toml_lines import key_lines, line_of
from slipd.errors import ConfigError, ConfigFault

#: The table that each key opens; a finger's own name stands between ``finger`` and its keys.
_TABLES: dict[str, type[BaseModel]] = {
    "wrench": Wrench,
    "pad": Pad,
    "slip": Slip,
    "pad_from_sensor": Pose,
    "gripper": Gripper,
    "grasp": Grasp,
    "reflex": Reflex,
    "levels": Levels,
    "rates": Rates,
    "bus": Bus,
    "requests": Requests,
    "recording": Recording,
}


def load(path: Path) -> Config:
    """Read a config file that nobody else may change (`slipd.config.path_trust`).

    Raises:
        ConfigError: The file cannot be read, other users may change it, or it has faults; each is named.
    """
    try:
        text = path.read_text(encoding="utf-8")
        untrusted = trust_faults(path)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise ConfigError(str(path), [ConfigFault("", None, f"cannot be read: {reason}")]) from None
    if untrusted:
        raise ConfigError(str(path), [ConfigFault("", None, fault) for fault in untrusted])
    return parse(text, str(path))


def parse(text: str, file: str) -> Config:
    """Makes a config of its text; ``file`` names it in errors.

    Raises:
        ConfigError: The text has faults; all of them are told.
    """
    try:
        tree = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # beside TOML's own: an endless number, a bottomless list
        where = re.search(r"\(at line (\d+)", str(error))
        raise ConfigError(file, [ConfigFault("", int(where[1]) if where else None, f"not TOML: {error}")]) from None
    lines = key_lines(text)
    try:
        config = Config.model_validate(tree)
    except ValidationError as error:
        told = error.errors(include_url=False)
        found = [_told(fault["loc"], fault) for fault in told]
        for fault in told:
            _take_out(tree, fault["loc"])
        with contextlib.suppress(ValidationError):  # what is right may still not fit together
            found += [(tuple(path.split(".")), m) for path, m in meaning_faults(Config.model_validate(tree))]
        raise _config_error(file, lines, found) from None
    faults = meaning_faults(config)
    if faults:
        raise _config_error(file, lines, [(tuple(path.split(".")), message) for path, message in faults])
    return config.with_text(text)


def shipped(name: str) -> Path:
    """Finds a file of ``config/``: in the source tree, or in the installed package."""
    source_tree = Path(__file__).parents[3] / "config" / name
    return source_tree if source_tree.is_file() else Path(str(resources.files("slipd") / "shipped_config" / name))


def _config_error(
    file: str, lines: dict[tuple[str, ...], int], found: list[tuple[tuple[str, ...], str]]
) -> ConfigError:
    return ConfigError(file, [ConfigFault(".".join(path), line_of(lines, path), message) for path, message in found])


def _take_out(tree: Any, location: tuple[int | str, ...]) -> None:
    """Removes a faulty value, so that its default stands for it; in a list there is no default, so the list goes."""
    for depth, key in enumerate(location):
        if not isinstance(tree, dict) or key not in tree:
            return
        last = depth == len(location) - 1 or not isinstance(tree[key], dict)
        if last:
            del tree[key]
            return
        tree = tree[key]


#: Type of a fault that pydantic finds → the rule in the words of a config's author.
_TYPE_RULES = {
    "finite_number": "must be a finite number",
    "float_type": "must be a number",
    "int_type": "must be an integer",
    "bool_type": "must be true or false",
    "string_type": "must be a text in quotes",
    "list_type": "must be a list",
}


def _told(location: tuple[int | str, ...], fault: Any) -> tuple[tuple[str, ...], str]:
    path = tuple(str(part) for part in location)
    if fault["type"] == "extra_forbidden":
        known = _keys_beside(path)
        near = difflib.get_close_matches(path[-1], known, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"known here: {', '.join(known)}"
        return path, f"unknown key; {hint}"
    if fault["type"] == "missing":
        return path, "is missing"
    if fault["type"] == "value_error":  # one of our own, which says what was found
        return path, str(fault["ctx"]["error"])
    rule = _rule(fault["type"], fault.get("ctx", {})) or str(fault["msg"]).replace("Input should", "must")
    return path, f"{rule[0].lower()}{rule[1:]}, got {fault['input']!r}"


def _rule(kind: str, context: Mapping[str, Any]) -> str:
    """State the rule behind a fault that pydantic finds, by its type; "" if pydantic's own text will do."""
    bounds = {
        "greater_than": ("above", "gt", ""),
        "greater_than_equal": ("at least", "ge", ""),
        "less_than": ("below", "lt", ""),
        "less_than_equal": ("at most", "le", ""),
        "too_short": ("at least", "min_length", " values"),
        "too_long": ("at most", "max_length", " values"),
    }
    if kind in bounds:
        relation, key, what = bounds[kind]
        return f"must {'have' if what else 'be'} {relation} {context[key]:.15g}{what}"
    return _TYPE_RULES.get(kind, "")


def _keys_beside(path: tuple[str, ...]) -> list[str]:
    """Keys that the table round ``path`` may hold."""
    tables = path[:-1]
    if not tables:
        return sorted(Config.model_fields)
    model = _TABLES.get(tables[-1], Config)
    if tables[0] == "finger" and len(tables) == 2:
        model = Finger
    elif tables[:2] == ("grasp", "pads") and len(tables) == 3:
        model = PadPlace
    return sorted(model.model_fields)
