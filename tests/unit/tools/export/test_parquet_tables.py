"""Parquet files: every value of every message is in its column, with its type."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from flat_messages import flat

from slipd.tools.export import parquet_tables
from slipd.tools.export.message_columns import columns
from slipd.tools.export.parquet_tables import ParquetTables

if TYPE_CHECKING:
    from conftest import Dated

parquet = pytest.importorskip("pyarrow.parquet")


def rows(path: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = parquet.read_table(path).to_pylist()
    return found


def test_every_value_of_every_message_is_in_its_column(exported: dict[str, Path], dated: Dated) -> None:
    tables = {path.stem: iter(rows(path)) for path in exported["parquet"].iterdir()}
    for log_ns, topic, body in dated:
        row = next(tables[topic])
        assert row.pop("published_ns") == log_ns
        for name, value in flat(body, spread=False).items():
            if value is None and name not in row:  # a vector, or a part, that is not known
                assert {each for key, each in row.items() if key.startswith(f"{name}.")} == {None}
            elif isinstance(row[name], str) and not isinstance(value, str):
                assert json.loads(row[name]) == value, (topic, name)
            else:
                assert row[name] == value, (topic, name)
    assert [next(each, None) for each in tables.values()] == [None] * len(tables)


def test_columns_have_types_of_their_own(exported: dict[str, Path]) -> None:
    types = {
        f"{path.stem} {field.name}": str(field.type)
        for path in exported["parquet"].iterdir()
        for field in parquet.read_schema(path)
    }
    assert types["slip.left published_ns"] == types["slip.left level_code"] == "int64"
    assert types["slip.left utilisation"] == types["wrench.left force_n.x"] == types["gripper force_n"] == "double"
    assert types["slip.left level"] == types["status notices"] == "string"
    assert types["gripper moving"] == "bool"
    assert types["slip.left reasons"] == "list<element: string>"
    assert types["tactile.left loads_n"] == "list<element: double>"


def test_blocks_of_rows_are_one_table(tmp_path: Path, dated: Dated, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parquet_tables, "ROWS", 4)
    tables = ParquetTables(tmp_path / "out")
    slips = [each for each in dated if each[1] == "slip.left"][:10]
    for log_ns, topic, body in slips:
        tables.write(log_ns, topic, body)
    tables.finish()
    tables.close()
    found = parquet.ParquetFile(tmp_path / "out" / "slip.left.parquet")
    assert found.num_row_groups == 3
    assert found.read()["published_ns"].to_pylist() == [log_ns for log_ns, _, _ in slips]


def test_notices_are_kept_with_their_texts() -> None:
    body = {"notices": {"tuning": "the tuning is kept"}}
    (notices,) = [column for column in columns("status", body) if column.name.startswith("notices")]
    assert (notices.name, notices.kind, notices.value(body)) == ("notices", "json", body["notices"])
