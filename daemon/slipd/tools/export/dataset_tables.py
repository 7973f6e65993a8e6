"""The Parquet tables of a data set for learning: frames, episodes with their statistics, and tasks."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from slipd.tools.export.feature_stats import QUANTILES
from slipd.tools.export.frame_layout import Feature
from slipd.tools.export.parquet_file import ParquetFile
from slipd.tools.parquet_library import parquet_library

OPTION = "--to lerobot"
EPISODES = 50
"""Rows that are written at once: with the statistics of two large pads, some 100 kB each."""

STATS = ("min", "max", "mean", "std", "count", *QUANTILES)


def frame_schema(features: Sequence[Feature]) -> Any:
    """Return the Arrow schema of the frames: a list of fixed length for each feature, or a scalar for a single number.

    Raises:
        SlipdError: pyarrow is not installed.
    """
    arrow, _ = parquet_library(OPTION)
    types = {"float32": arrow.float32(), "int64": arrow.int64()}
    fields = []
    for each in features:
        kind, size = types[each.dtype], len(each.names)
        fields.append((each.name, kind if size == 1 else arrow.list_(kind, size)))
    return arrow.schema(fields)


def frame_table(schema: Any, block: Mapping[str, npt.NDArray[Any]]) -> Any:
    """Return the frames of a block, one row each, as an Arrow table."""
    arrow, _ = parquet_library(OPTION)
    arrays = []
    for field in schema:
        numbers = arrow.array(np.ravel(block[field.name]))
        size = block[field.name].shape[1]
        arrays.append(numbers if size == 1 else arrow.FixedSizeListArray.from_arrays(numbers, size))
    return arrow.Table.from_arrays(arrays, schema=schema)


class EpisodeTable:
    """Writes ``meta/episodes``.

    Args:
        path: File to create; its folder too.
        features: Features with statistics.

    Attributes:
        count: Episodes so far.
    """

    def __init__(self, path: Path, features: Sequence[Feature]) -> None:
        self._arrow, _ = parquet_library(OPTION)
        path.parent.mkdir(parents=True)
        self.count = 0
        self._schema = _episode_schema(self._arrow, features)
        self._rows: list[dict[str, Any]] = []
        self._file = ParquetFile(path, self._schema)

    def add(self, row: Mapping[str, Any], stats: Mapping[str, Mapping[str, Any]]) -> None:
        """Add the next episode: its columns but the indices, and the statistics of each feature."""
        flat = {f"stats/{name}/{key}": value for name, found in stats.items() for key, value in found.items()}
        place = {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        self._rows.append({"episode_index": self.count, **row, **flat, **place})
        self.count += 1
        if len(self._rows) == EPISODES:
            self._flush()

    def finish(self) -> None:
        """Complete the file and close it."""
        self._flush()
        self._file.finish()

    def close(self) -> None:
        """Close the file as it is; does nothing after `finish`."""
        self._file.close()

    def _flush(self) -> None:
        if self._rows:
            self._file.write(self._arrow.Table.from_pylist(self._rows, schema=self._schema))
            self._rows.clear()


def _episode_schema(arrow: Any, features: Sequence[Feature]) -> Any:
    numbers, counts = arrow.list_(arrow.float64()), arrow.list_(arrow.int64())
    integers = ("length", "data/chunk_index", "data/file_index", "dataset_from_index", "dataset_to_index")
    return arrow.schema(
        {
            "episode_index": arrow.int64(),
            "tasks": arrow.list_(arrow.string()),
            **dict.fromkeys(integers, arrow.int64()),
            "recording": arrow.string(),
            "begin_unix_ns": arrow.int64(),
            **{
                f"stats/{each.name}/{stat}": counts if stat == "count" else numbers
                for each in features
                for stat in STATS
            },
            "meta/episodes/chunk_index": arrow.int64(),
            "meta/episodes/file_index": arrow.int64(),
        }
    )


def write_tasks(path: Path, tasks: Sequence[str]) -> None:
    """Write ``meta/tasks.parquet``: pandas, with which LeRobot reads it, gets the tasks as the index."""
    arrow, _ = parquet_library(OPTION)
    columns = [("task_index", "int64", "int64"), ("task", "unicode", "object")]
    described = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
        for name, kind, numpy in columns
    ]
    pandas = {"index_columns": ["task"], "column_indexes": [], "columns": described, "pandas_version": "2.0.0"}
    schema = arrow.schema(
        {"task_index": arrow.int64(), "task": arrow.string()}, metadata={"pandas": json.dumps(pandas)}
    )
    file = ParquetFile(path, schema)
    try:
        file.write(arrow.Table.from_arrays([range(len(tasks)), list(tasks)], schema=schema))
        file.finish()
    finally:
        file.close()
