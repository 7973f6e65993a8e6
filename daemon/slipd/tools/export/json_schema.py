"""JSON schemas of the messages, made from the wire schema, and messages that fit them.

Foxglove and Lichtblick accept a part of JSON Schema: each property has one plain type, so ``["number", "null"]`` and
lists of lists are refused. So a quantity that is not known is left out, and points are objects of x and y.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from slipd_client.messages.schema.fields import Field, fields_of
from slipd_client.messages.schema.kinds import FLAG, HEALTH, INTEGER, LEVEL, NUMBER, PAIR, TEXT, Kind

Schema = dict[str, Any]

_PLAIN = {NUMBER: "number", INTEGER: "integer", HEALTH: "integer", TEXT: "string", LEVEL: "string", FLAG: "boolean"}
_POINT: Schema = {
    "type": "object",
    "properties": {"x": {"type": "number"}, "y": {"type": "number"}},
    "required": ["x", "y"],
    "additionalProperties": False,
}


def json_schema(cls: type[Any]) -> Schema:
    """Return the schema of a class of the wire."""
    fields = fields_of(cls)
    return {
        "type": "object",
        "properties": {each.name: {**_kind(each.kind), "description": each.meaning} for each in fields},
        "required": [each.name for each in fields if each.required and not each.nullable],
        "additionalProperties": False,
    }


def _kind(kind: Kind) -> Schema:
    if kind in _PLAIN:
        return {"type": _PLAIN[kind]}
    if kind.part is not None:
        return json_schema(kind.part)
    if kind.inner is None:  # a vector
        length = int(kind.name.strip("[]"))
        return {"type": "array", "items": {"type": "number"}, "minItems": length, "maxItems": length}
    if kind.name.startswith("map"):
        return {"type": "object", "additionalProperties": _kind(kind.inner)}
    return {"type": "array", "items": _POINT if kind.inner is PAIR else _kind(kind.inner)}


def for_json(cls: type[Any], body: dict[str, Any]) -> dict[str, Any]:
    """Return a map of the wire without what is not known, and with its points as objects."""
    found = {}
    for field, convert in _plan(cls):
        value = body.get(field.name)
        if value is not None:
            found[field.name] = value if convert is None else convert(value)
    return found


_PLANS: dict[type[Any], list[tuple[Field, Callable[[Any], Any] | None]]] = {}


def _plan(cls: type[Any]) -> list[tuple[Field, Callable[[Any], Any] | None]]:
    if cls not in _PLANS:
        _PLANS[cls] = [(field, _converter(field.kind)) for field in fields_of(cls)]
    return _PLANS[cls]


def _converter(kind: Kind) -> Callable[[Any], Any] | None:
    """Return what makes a value of a kind fit its schema; None if it fits as it is."""
    if kind.part is not None:
        part = kind.part
        return lambda value: for_json(part, value)
    if kind.inner is PAIR:
        return lambda pairs: [{"x": x, "y": y} for x, y in pairs]
    if kind.inner is None or (convert := _converter(kind.inner)) is None:
        return None
    return lambda entries: {key: convert(entry) for key, entry in entries.items()}
