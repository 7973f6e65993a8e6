"""CSV and Parquet files: every value of every message is in its column, and a column has one type."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from replays import RECORDINGS

from slipd import config
from slipd.recording.reader import open_recording
from slipd.tools.export import message_tables
from slipd.tools.export.message_tables import columns, csv_files, parquet_tables

if TYPE_CHECKING:
    from conftest import Dated

parquet = pytest.importorskip("pyarrow.parquet")

RIG = config.parse(open_recording(RECORDINGS / "demo.mcap").config_text, "demo")


ENDS = {2: "xy", 3: "xyz"}


def flat(value: Any, name: str = "", *, spread: bool = True) -> dict[str, Any]:
    """Return the columns that a value of the wire has, by name; ``spread``: each load of a pad has one."""
    if isinstance(value, dict) and not name.endswith(("taxel_faults", "notices")):
        prefix = f"{name}." if name else ""
        return {
            key: each
            for part, inner in value.items()
            for key, each in flat(inner, prefix + part, spread=spread).items()
        }
    vector = isinstance(value, list) and name.endswith(("_n", "_m", "_nm")) and name != "corners_m"
    if vector and len(value) in ENDS:
        return {f"{name}.{end}": each for end, each in zip(ENDS[len(value)], value, strict=True)}
    if name == "loads_n" and value is not None and spread:
        return {f"{name}.{index}": each for index, each in enumerate(value)}
    return {name: value}


def rows_of(path: Path) -> list[dict[str, Any]]:
    if path.suffix == ".parquet":
        found: list[dict[str, Any]] = parquet.read_table(path).to_pylist()
        return found
    with path.open(encoding="utf-8", newline="") as file:
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


@pytest.mark.parametrize("to", ["csv", "parquet"])
def test_every_value_of_every_message_is_in_its_column(to: str, exported: dict[str, Path], dated: Dated) -> None:
    tables = {path.stem: rows_of(path) for path in exported[to].iterdir()}
    assert {topic: len(rows) for topic, rows in tables.items()} == {
        topic: sum(each == topic for _, each, _ in dated) for _, topic, _ in dated
    }
    following = {topic: iter(rows) for topic, rows in tables.items()}
    for log_ns, topic, body in dated:
        row = next(following[topic])
        assert str(row.pop("published_ns")) == str(log_ns)
        for name, value in flat(body, spread=to == "csv").items():
            if value is None and name not in row:  # a vector, or a part, that is not known
                assert not any(each for key, each in row.items() if key.startswith(f"{name}."))
            elif to == "csv":
                assert matches(row[name], value), (topic, name)
            elif isinstance(row[name], str) and not isinstance(value, str):
                assert json.loads(row[name]) == value, (topic, name)
            else:
                assert row[name] == value, (topic, name)


def test_a_text_that_a_spreadsheet_would_compute_is_quoted_and_a_number_is_not(tmp_path: Path) -> None:
    texts = ("=1+1", "+1", "-1", "@A1", "\t=1", "\r=1", "a=1", "")
    with csv_files(tmp_path / "csv", RIG) as write:
        for text in texts:
            body = {"finger": text, "reasons": [text], "level": "stable", "normal_n": -1.5, "rate_hz": None}
            write(1, "slip.left", body)
    for text, row in zip(texts, rows_of(tmp_path / "csv" / "slip.left.csv"), strict=True):
        shown = {"a=1": text, "": text, "\r=1": "\\r=1"}.get(text, f"'{text}")
        assert (row["finger"], row["reasons"]) == (shown, shown)
        assert row["normal_n"] == "-1.5"


def test_columns_have_types_of_their_own(exported: dict[str, Path]) -> None:
    types = {
        f"{path.stem} {field.name}": str(field.type)
        for path in exported["parquet"].iterdir()
        for field in parquet.read_schema(path)
    }
    assert types == types | {
        "slip.left published_ns": "int64",
        "slip.left level_code": "int64",
        "slip.left utilisation": "double",
        "wrench.left force_n.x": "double",
        "gripper force_n": "double",
        "slip.left level": "string",
        "status notices": "string",
        "gripper moving": "bool",
        "slip.left reasons": "list<element: string>",
        "tactile.left loads_n": "list<element: double>",
    }


def test_blocks_of_rows_are_one_table(tmp_path: Path, dated: Dated, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(message_tables, "ROWS", 4)
    slips = [each for each in dated if each[1] == "slip.left"][:10]
    with parquet_tables(tmp_path / "out", RIG) as write:
        for message in slips:
            write(*message)
    found = parquet.ParquetFile(tmp_path / "out" / "slip.left.parquet")
    assert found.num_row_groups == 3
    assert found.read()["published_ns"].to_pylist() == [log_ns for log_ns, _, _ in slips]


def test_notices_are_kept_with_their_texts() -> None:
    body = {"notices": {"tuning": "the tuning is kept"}}
    (notices,) = [column for column in columns("status", body) if column.name.startswith("notices")]
    assert (notices.name, notices.kind, notices.value(body)) == ("notices", "json", body["notices"])
