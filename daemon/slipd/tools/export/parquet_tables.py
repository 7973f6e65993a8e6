"""A folder with one Parquet file for each topic: one row for each message, and one column for each value.

The columns are those of the CSV files, with types: what is not known is null, lists of words are lists, and the loads
of a pad are one list. Lists of no fixed length are JSON.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from slipd.tools.export.message_columns import ABSENT, LOG_TIME, Column, columns
from slipd.tools.export.message_files import Body
from slipd.tools.export.parquet_file import ParquetFile
from slipd.tools.parquet_library import parquet_library

ROWS = 10_000
"""Rows that are written at once; a message with the loads of a pad takes some kilobytes until then."""


class ParquetTables:
    """Writes the files.

    Args:
        folder: Folder to create.

    Raises:
        SlipdError: pyarrow is not installed.
    """

    def __init__(self, folder: Path) -> None:
        self._arrow, _ = parquet_library("--to parquet")
        folder.mkdir()
        self._folder = folder
        self._topics: dict[str, _TopicTable] = {}

    def write(self, log_ns: int, topic: str, body: Body) -> None:
        """Write a message that was published at ``log_ns``, ns since 1970."""
        if topic not in self._topics:
            path = self._folder / f"{topic}.parquet"
            self._topics[topic] = _TopicTable(self._arrow, path, columns(topic, body))
        self._topics[topic].add(log_ns, body)

    def finish(self) -> None:
        """Complete the files and close them."""
        for table in self._topics.values():
            table.flush()
            table.file.finish()

    def close(self) -> None:
        """Close the files as they are; does nothing after `finish`."""
        for table in self._topics.values():
            table.file.close()


class _TopicTable:
    """The rows of one topic that are not written yet, and its file."""

    def __init__(self, arrow: Any, path: Path, found: list[Column]) -> None:
        self._arrow = arrow
        self._columns = found
        types = _types(arrow)
        fields = [(LOG_TIME, arrow.int64()), *((column.name, types[column.kind]) for column in found)]
        self._schema = arrow.schema(fields)
        self._values: list[list[Any]] = [[] for _ in fields]
        self.file = ParquetFile(path, self._schema)

    def add(self, log_ns: int, body: Body) -> None:
        times, *lists = self._values
        times.append(log_ns)
        for column, values in zip(self._columns, lists, strict=True):
            value = column.value(body)
            convert = _CONVERSIONS.get(column.kind)
            known = value is not None and value is not ABSENT
            values.append((value if convert is None else convert(value)) if known else None)
        if len(times) == ROWS:
            self.flush()

    def flush(self) -> None:
        if not self._values[0]:
            return
        arrays = [
            self._arrow.array(values, field.type) for values, field in zip(self._values, self._schema, strict=True)
        ]
        self.file.write(self._arrow.Table.from_arrays(arrays, schema=self._schema))
        for values in self._values:
            values.clear()


_CONVERSIONS: dict[str, Callable[[Any], Any]] = {"number": float, "text": str, "json": json.dumps}
"""Converts a value to the type of its column, by the kind of the column, where it may have another."""


def _types(arrow: Any) -> dict[str, Any]:
    return {
        "number": arrow.float64(),
        "integer": arrow.int64(),
        "flag": arrow.bool_(),
        "text": arrow.string(),
        "words": arrow.list_(arrow.string()),
        "numbers": arrow.list_(arrow.float64()),
        "json": arrow.string(),
    }
