"""Type, unit and range of a key, from its annotation and its name, for the page of the config."""

from __future__ import annotations

import types
from collections.abc import Iterator
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import AfterValidator, BaseModel
from pydantic.fields import FieldInfo

from slipd.config.value_bounds import Bounds, unit_quaternion

_TYPES = {float: "number", int: "integer", bool: "true, false", str: "text"}

_UNITS = {
    "n_per_s": "N/s", "hz": "Hz", "nm": "N·m", "kg": "kg", "ms": "ms", "m": "m", "n": "N", "s": "s", "bytes": "bytes",
    "per_hour": "1/h", "baud": "bit/s",
}  # fmt: skip
"""End of a key → unit; the first that fits."""


def type_of(field: FieldInfo) -> str:
    """Return the type in the words of TOML."""
    return _type(field.annotation)


def unit_of(key: str, field: FieldInfo) -> str:
    """Return the unit; "" for plain numbers, texts and tables of several units."""
    for rule in _rules(field):
        if isinstance(rule, Bounds) and rule.unit:
            return rule.unit
    return next((unit for end, unit in _UNITS.items() if f"_{key}".endswith(f"_{end}")), "")


def range_of(field: FieldInfo) -> str:
    """Return the least and the largest value or length, without limits that depend on other keys."""
    rules = list(_rules(field))
    found = [_values(rules), _length(rules)]
    return ", ".join(text for text in found if text)


def _values(rules: list[Any]) -> str:
    bounds = [rule for rule in rules if isinstance(rule, Bounds)]
    above, below = _limit(rules, "gt"), _limit(rules, "lt")
    least = above or _limit(rules, "ge") or [rule.least for rule in bounds]
    most = below or _limit(rules, "le") or [rule.most for rule in bounds]
    zero = ", or 0" * any(rule.zero for rule in bounds)
    if least and most and not above and not below:
        return f"{least[0]:.10g} to {most[0]:.10g}{zero}"
    found = [f"{'above' if above else 'at least'} {value:.10g}" for value in least]
    found += [f"{'below' if below else 'at most'} {value:.10g}" for value in most]
    return ", ".join(found) + zero


def _length(rules: list[Any]) -> str:
    if unit_quaternion in rules:
        return "4 values, length 1"
    least, most = _limit(rules, "min_length"), _limit(rules, "max_length")
    if not least:
        return ""
    if most:
        return f"{least[0]} values" if least == most else f"{least[0]} to {most[0]} values"
    return f"at least {least[0]} values" if least[0] > 1 else "not empty"


def _limit(rules: list[Any], name: str) -> list[Any]:
    """Return the limit of this name in a list, which is empty where no rule has it."""
    return [value for rule in rules if (value := getattr(rule, name, None)) is not None][:1]


def _rules(field: FieldInfo) -> Iterator[Any]:
    """Yield what limits a value, also inside ``X | None``; of a list, only what limits the list."""
    yield from map(_plain, field.metadata)
    yield from _nested(field.annotation)


def _nested(annotation: Any) -> Iterator[Any]:
    if get_origin(annotation) in (Union, types.UnionType):
        for each in get_args(annotation):
            yield from _nested(each)
    elif get_origin(annotation) is Annotated:
        inner, *rules = get_args(annotation)
        yield from _nested(inner)
        for rule in rules:
            yield from (map(_plain, rule.metadata) if isinstance(rule, FieldInfo) else [_plain(rule)])


def _plain(rule: Any) -> Any:
    return rule.func if isinstance(rule, AfterValidator) else rule


def _type(annotation: Any) -> str:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _type(arguments[0])
    if origin in (Union, types.UnionType):
        return " or ".join(_type(each) for each in arguments if each is not type(None))
    if origin is Literal:
        return ", ".join(f'`"{each}"`' if isinstance(each, str) else f"`{each}`" for each in arguments)
    if origin is list:
        return f"list of {_plural(_type(arguments[0]))}"
    if origin is tuple:
        return f"row of {len(arguments)} numbers"
    if origin is dict or (isinstance(annotation, type) and issubclass(annotation, BaseModel)):
        return "table"
    return _TYPES[annotation]


def _plural(words: str) -> str:
    first, _, rest = words.partition(" ")
    return f"{first}s {rest}".strip()
