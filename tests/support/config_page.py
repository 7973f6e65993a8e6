"""``docs/config.md``: every key of a config, made from the model; ``python -m config_page docs/config.md`` writes it.

The text of a key is in the docstring of its class: what it is, and after "Wrong:" what a wrong value does that no
check can find. Type, range and default come from its annotation, the unit from the end of its name.
"""

from __future__ import annotations

import inspect
import json
import re
import sys
import types
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import AfterValidator, BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from wire_tables import table

from slipd.config import Finger, Stream
from slipd.config.model import TABLES
from slipd.config.value_bounds import Bounds, unit_quaternion
from slipd.tools.devices_command import in_words, section_of, sentence

HEAD = """\
# Config

Every key of a config file, made from the model that checks the file (`tests/support/config_page.py`). The files of
[`config`](../config) show all keys in use: `slipd config list` lists them, `slipd config show NAME > my_rig.toml`
copies one, and `slipd check my_rig.toml` reports every fault of your copy at once. The options of a device are
printed by `slipd devices NAME`; they are keys of `options`, such as `options = { sinc_length = 512 }`.

- **Refused.** An unknown or missing key or option, another type, a value out of its range, NaN, infinity, and values
  that do not fit each other refuse the whole file. The error states the line, the rule, what was found, and the
  probable intention.
- **Warned of.** `slipd check` also reports what is possible but suspicious, such as a friction coefficient above 1.2.
- **Undetected.** The last column states what a value causes that is possible but wrong. No check can find it:
  measure.

The end of a key names its unit. A key that is "required" has no default; "left out" is a default with a meaning of
its own. `X` is the name of a finger, 1 to 32 characters a-z and 0-9; there must be at least one `[finger.X]`.
"""

TITLES = ("key", "type", "unit", "default", "range", "meaning", "if it is wrong")


def reference() -> str:
    """Return the page."""
    parts = [HEAD]
    for name, model in TABLES.items():
        if _table_above(name) is None:
            below = [each for each in TABLES.items() if _table_above(each[0]) == name]
            parts.append(_section(f"`[{name}]`", model, below))
        if model is Finger:
            parts.append(_section("Keys of every device", Stream))
    return "\n".join(parts)


def _table_above(name: str) -> str | None:
    """Return the table that lists this one; None if it has a section of its own, as those of a finger have."""
    above = [each for each in TABLES if name.startswith(f"{each}.") and TABLES[each] is not Finger]
    return above[0] if above else None


def _section(title: str, model: type[BaseModel], below: Iterable[tuple[str, type[BaseModel]]] = ()) -> str:
    rows = list(_rows(model))
    for name, lower in below:
        rows += [(f"**`[{name}]`**", "table", "", "", "", _about(lower), ""), *_rows(lower)]
    return f"## {title}\n\n{_about(model)}\n\n{table(TITLES, rows)}"


def _about(model: type[BaseModel]) -> str:
    also = " It also has the [keys of every device](#keys-of-every-device)." if Stream in model.__mro__[1:] else ""
    first = (inspect.getdoc(model) or "").partition("\n\n")[0]
    return in_words(re.sub(r"^``\[?[\w.]+\]?``[:.]? ?", "", first)) + also


def _rows(model: type[BaseModel]) -> Iterator[tuple[str, ...]]:
    texts = section_of(model, "Attributes")
    for key, field in model.model_fields.items():
        if _has_own_section(field.annotation) or (model is not Stream and key in Stream.model_fields):
            continue
        meaning, _, wrong = texts[key].partition(" Wrong: ")
        yield (
            f"`{key}`",
            type_of(field),
            unit_of(key, field),
            _default(field),
            range_of(field),
            meaning,
            sentence(wrong),
        )


def _has_own_section(annotation: Any) -> bool:
    if get_origin(annotation) in (Union, types.UnionType):
        return any(map(_has_own_section, get_args(annotation)))
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    if value is None or value is PydanticUndefined:
        return "left out"
    if isinstance(value, BaseModel):
        return "its defaults"
    return f"`{json.dumps(value)}`"


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
    return ", ".join(filter(None, (_values(rules), _length(rules))))


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
        first, _, rest = _type(arguments[0]).partition(" ")
        return f"list of {first}s {rest}".strip()
    if origin is tuple:
        return f"row of {len(arguments)} numbers"
    if origin is dict or (isinstance(annotation, type) and issubclass(annotation, BaseModel)):
        return "table"
    return _TYPES[annotation]


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(reference(), encoding="utf-8")
