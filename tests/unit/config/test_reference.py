"""docs/config.md is made from the model, and explains every key."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, get_args

import pytest
from config_page import range_of, reference, type_of, unit_of
from project import DOCS
from pydantic import BaseModel

from slipd.config import Config, Stream
from slipd.config.config_file import explain
from slipd.config.model import TABLES
from slipd.devices import DEVICES
from slipd.tools.devices_command import options_of, section_of


def test_the_page_is_that_of_the_model() -> None:
    made = "write it again: PYTHONPATH=tests/support python -m config_page docs/config.md"
    assert (DOCS / "config.md").read_text(encoding="utf-8") == reference(), made


def models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
        for field in annotation.model_fields.values():
            yield from models_in(field.annotation)
    for part in get_args(annotation):
        yield from models_in(part)


def test_every_table_of_a_config_is_on_the_page() -> None:
    assert set(TABLES.values()) == set(models_in(Config)) - {Config}


def test_an_unknown_key_is_answered_with_the_keys_of_its_own_table() -> None:
    for table, model in TABLES.items():
        path, text = explain({"loc": (*table.replace("X", "left").split("."), "zzz"), "type": "extra_forbidden"})
        assert (path[-1], text) == ("zzz", f"unknown key; known here: {', '.join(sorted(model.model_fields))}")


def test_the_docstring_of_a_table_says_what_each_key_is_and_what_a_wrong_value_does() -> None:
    for model in (Stream, *TABLES.values()):
        texts = section_of(model, "Attributes")
        inherited = set(Stream.model_fields) if model is not Stream and issubclass(model, Stream) else set()
        assert set(texts) | inherited >= set(model.model_fields), f"{model.__name__}: an entry for each key"
        for key, text in texts.items():
            assert re.fullmatch(r".*\. Wrong: .*\.", text), (
                f"{model.__name__}.{key}: what it is. Wrong: what that does."
            )


@pytest.mark.parametrize(
    ("table", "key", "type_", "unit", "range_"),
    [
        ("finger.X", "mu", "number", "", "0.01 to 2"),
        ("finger.X", "min_normal_n", "number", "N", "above 0"),
        ("finger.X", "load_rule", '`"matched"`, `"grey"`, `"binary"`', "", ""),
        ("finger.X.wrench", "mass_kg", "number", "kg", "1e-05 to 10, or 0"),
        ("finger.X.wrench", "com_m", "list of numbers", "m", "-1 to 1, 3 values"),
        ("finger.X.wrench", "stuck_after", "integer", "", "at least 0"),
        ("finger.X.wrench", "range_nm", "number", "N·m", "0.0001 to 100000"),
        ("finger.X.wrench.pad_from_sensor", "quat_xyzw", "list of numbers", "", "4 values, length 1"),
        ("finger.X.pad", "rows", "integer", "", "above 0, at most 64"),
        ("finger.X.pad", "gain_error", "number", "", "above 0, below 1"),
        ("finger.X.pad", "swap_xy", "true, false", "", ""),
        ("gripper", "force_table", "list of rows of 2 numbers", "", "at least 2 values"),
        ("gripper", "step_n", "number", "N", "above 0, at most 5000"),
        ("gripper", "raise_n_per_s", "number", "N/s", "0.001 to 50000"),
        ("gripper", "port", "text", "", "not empty"),
        ("grasp", "pads", "table", "", "2 values"),
        ("levels", "false_alarms_per_hour", "number", "/h", "0.001 to 100"),
        ("recording", "max_bytes", "integer", "bytes", "at least 1000000"),
    ],
)
def test_type_unit_and_range_are_those_of_the_checks(table: str, key: str, type_: str, unit: str, range_: str) -> None:
    field = TABLES[table].model_fields[key]
    assert (type_of(field), unit_of(key, field), range_of(field)) == (type_, unit, range_)


def test_every_option_of_a_device_is_described() -> None:
    options = {name: list(options_of(device)) for name, device in DEVICES.items()}
    assert {name for name, rows in options.items() if not rows} == {"external", "pvdf"}
    rows = [row for each in options.values() for row in each]
    assert all(meaning and not meaning.startswith("See `") for *_, meaning in rows)
    assert "`wiring`" not in {option for option, *_ in rows}, "it follows from the port"
