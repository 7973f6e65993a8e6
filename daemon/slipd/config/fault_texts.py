"""Texts of the faults that pydantic finds, in the words of a config's author: key, rule, what was found."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from slipd.config.bus_model import Bus, Requests
from slipd.config.finger_model import Finger, Pad, Pose, Slip, Wrench
from slipd.config.gripper_model import Grasp, Gripper, ObservedObject, PadPlace, Reflex
from slipd.config.host_model import Realtime
from slipd.config.levels_model import Levels, Rates
from slipd.config.model import Config
from slipd.config.recording_model import Continuous, Incidents, Recording

_TABLES: dict[str, type[BaseModel]] = {
    "wrench": Wrench,
    "pad": Pad,
    "slip": Slip,
    "pad_from_sensor": Pose,
    "gripper": Gripper,
    "grasp": Grasp,
    "object": ObservedObject,
    "reflex": Reflex,
    "levels": Levels,
    "rates": Rates,
    "bus": Bus,
    "requests": Requests,
    "recording": Recording,
    "continuous": Continuous,
    "incidents": Incidents,
    "realtime": Realtime,
}
"""The table that each key opens; the name of a finger stands between ``finger`` and its keys."""

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
    tables = path[:-1]
    if not tables:
        return sorted(Config.model_fields)
    model = _TABLES.get(tables[-1], Config)
    if tables[0] == "finger" and len(tables) == 2:
        model = Finger
    elif tables[:2] == ("grasp", "pads") and len(tables) == 3:
        model = PadPlace
    return sorted(model.model_fields)
