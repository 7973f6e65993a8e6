"""``docs/config.md``: every key of a config, made from the model; ``python -m slipd.config.reference docs/config.md``.

The text of a key is in the docstring of its class: what it is, and after "Wrong:" what a wrong value does that no
check can find. Type, range and default come from its annotation, the unit from the end of its name.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from slipd.config.config_tables import TABLES
from slipd.config.docstring_parts import attributes_of, sentence, summary_of
from slipd.config.finger_model import Finger
from slipd.config.key_types import range_of, type_of, unit_of
from slipd.config.option_tables import option_rows
from slipd.config.stream_model import Stream

HEAD = """\
# Config

Every key of a config file. This page is made from the model that checks the file, by
`python -m slipd.config.reference docs/config.md`. The files of [`config`](../config) show all keys in use:
`slipd config list` lists them, `slipd config show NAME > my_rig.toml` copies one, and `slipd check my_rig.toml` reports
every fault of your copy at once.

- **Refused.** An unknown or missing key, another type, a value out of its range, NaN, infinity, and values that do not
  fit each other refuse the whole file. The error states the line, the rule, what was found, and the probable intention.
- **Warned of.** `slipd check` also reports what is possible but suspicious, such as a friction coefficient above 1.2.
- **Undetected.** The last column states what a value causes that is possible but wrong. No check can find it: measure.

The end of a key names its unit. A key that is "required" has no default; "left out" is a default with a meaning of its
own. `X` is the name of a finger, 1 to 32 characters a-z and 0-9; there must be at least one `[finger.X]`.
"""

OPTIONS_HEAD = """\
## Options of the devices

They are keys of `options` in the table of a device, such as `options = { sinc_length = 512 }`. An unknown option,
another type or an impossible value refuses the config. Devices without options are not listed. [Devices](devices.md)
describes wiring, rates and error detection.

"""

TITLES = ("key", "type", "unit", "default", "range", "meaning", "if it is wrong")


def reference() -> str:
    """Return the page."""
    parts = [HEAD]
    for name, model in TABLES.items():
        parts.append(_section(f"`[{name}]`", model))
        if model is Finger:
            parts.append(_section("Keys of every device", Stream))
    parts.append(OPTIONS_HEAD + _table(("device", "option", "type", "default", "meaning"), option_rows()))
    return "\n".join(parts)


def _section(title: str, model: type[BaseModel]) -> str:
    also = " It also has the [keys of every device](#keys-of-every-device)." if Stream in model.__mro__[1:] else ""
    return f"## {title}\n\n{summary_of(model)}{also}\n\n{_table(TITLES, _rows(model))}"


def _rows(model: type[BaseModel]) -> Iterator[tuple[str, ...]]:
    texts = attributes_of(model)
    own = [key for key in model.model_fields if model is Stream or key not in Stream.model_fields]
    for key in own:
        field = model.model_fields[key]
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


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    if value is None or value is PydanticUndefined:
        return "left out"
    if isinstance(value, BaseModel):
        return "its defaults"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f'`"{value}"`' if isinstance(value, str) else f"`{value}`"


def _table(titles: tuple[str, ...], rows: Iterator[tuple[str, ...]]) -> str:
    lines = (titles, ("---",) * len(titles), *rows)
    return "".join("|" + "|".join(f" {cell} " if cell else " " for cell in line) + "|\n" for line in lines)


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(reference(), encoding="utf-8")
