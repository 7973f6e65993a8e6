"""CSV files: every value is there, and a column has one type."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from conftest import Dated


ENDS = {2: "xy", 3: "xyz"}


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def flat(value: Any, name: str) -> dict[str, Any]:
    """Return the columns that a value of the wire has, by name."""
    if isinstance(value, dict) and not name.endswith("taxel_faults"):
        prefix = f"{name}." if name else ""
        return {key: each for part, inner in value.items() for key, each in flat(inner, prefix + part).items()}
    vector = isinstance(value, list) and name.endswith(("_n", "_m", "_nm")) and name != "corners_m"
    if vector and len(value) in ENDS:
        return {f"{name}.{end}": each for end, each in zip(ENDS[len(value)], value, strict=True)}
    if name == "loads_n" and value is not None:
        return {f"{name}.{index}": each for index, each in enumerate(value)}
    return {name: value}


def matches(text: str, value: Any) -> bool:
    if value is None:
        return text in ("", "unknown")
    if isinstance(value, bool):
        return text == str(value).lower()
    if isinstance(value, list) and value and isinstance(value[0], str):
        return text == ";".join(value)
    if value == []:
        return text in ("", "[]")
    if isinstance(value, list | dict):
        return json.loads(text) == value
    return text == value if isinstance(value, str) else float(text) == value


def test_every_value_of_every_message_is_in_its_column(exported: dict[str, Path], dated: Dated) -> None:
    tables = {path.stem: table(path) for path in exported["csv"].iterdir()}
    assert {topic: len(rows) for topic, rows in tables.items()} == {
        topic: sum(each == topic for _, each, _ in dated) for _, topic, _ in dated
    }
    following = {topic: iter(rows) for topic, rows in tables.items()}
    for log_ns, topic, body in dated:
        row = next(following[topic])
        assert row.pop("published_ns") == str(log_ns)
        for name, value in flat(body, "").items():
            if value is None and name not in row:  # a vector, or a part, that is not known
                parts = [text for key, text in row.items() if key.startswith(f"{name}.")]
                assert set(parts) == {""}
            else:
                assert matches(row[name], value), (topic, name)


def kind(text: str) -> str:
    try:
        float(text)
    except ValueError:
        return "flag" if text in ("true", "false") else "text"
    return "integer" if text.lstrip("-").isdigit() else "float"


def test_a_column_has_one_type_and_every_number_has_its_unit(exported: dict[str, Path]) -> None:
    for path in exported["csv"].iterdir():
        rows = table(path)
        for name in rows[0]:
            kinds = {kind(row[name]) for row in rows if row[name] not in ("", "unknown")}
            assert len(kinds) <= 1 or name == "config_id" or name.endswith("boot"), (path.name, name, kinds)


def test_the_loads_of_a_pad_have_a_column_each_even_if_the_first_image_is_unusable(exported: dict[str, Path]) -> None:
    with (exported["csv"] / "tactile.left.csv").open(encoding="utf-8") as file:
        header = next(csv.reader(file))
    assert [name for name in header if name.startswith("loads_n.")] == [f"loads_n.{n}" for n in range(128)]
