"""CSV files: every value is there, and a column has one type."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flat_messages import flat

from slipd.tools.export.csv_files import CsvFiles

if TYPE_CHECKING:
    from conftest import Dated


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


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
    return text.removeprefix("'") == value if isinstance(value, str) else float(text) == value


def test_every_value_of_every_message_is_in_its_column(exported: dict[str, Path], dated: Dated) -> None:
    tables = {path.stem: table(path) for path in exported["csv"].iterdir()}
    assert {topic: len(rows) for topic, rows in tables.items()} == {
        topic: sum(each == topic for _, each, _ in dated) for _, topic, _ in dated
    }
    following = {topic: iter(rows) for topic, rows in tables.items()}
    for log_ns, topic, body in dated:
        row = next(following[topic])
        assert row.pop("published_ns") == str(log_ns)
        for name, value in flat(body).items():
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


def test_a_text_that_a_spreadsheet_would_compute_is_quoted_and_a_number_is_not(tmp_path: Path) -> None:
    texts = ("=1+1", "+1", "-1", "@A1", "\t=1", "\r=1", "a=1", "")
    files = CsvFiles(tmp_path / "csv")
    for text in texts:
        body = {"finger": text, "reasons": [text], "level": "stable", "normal_n": -1.5, "rate_hz": None}
        files.write(1, "slip.left", body)
    files.finish()
    with (tmp_path / "csv" / "slip.left.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for text, row in zip(texts, rows, strict=True):
        shown = {"a=1": text, "": text, "\r=1": "\\r=1"}.get(text, f"'{text}")
        assert (row["finger"], row["reasons"]) == (shown, shown)
        assert row["normal_n"] == "-1.5"
