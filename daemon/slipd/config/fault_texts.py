"""Texts of the faults that pydantic finds, in the words of a config's author: key, rule, what was found."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

from slipd.config.config_tables import table_model
from slipd.config.model import Config

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
