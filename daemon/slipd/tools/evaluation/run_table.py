"""A Parquet file with one row for each recording and config: levels, alarms, health of the streams, compute time.

Rows are written as runs finish, in any order, so the file needs no more memory for a million runs than for a thousand.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from types import ModuleType
from typing import Any

from slipd import __version__
from slipd.tools.draft import Kind, draft
from slipd.tools.evaluation.config_run import ConfigRun, StreamHealth
from slipd.tools.evaluation.executors import Finished
from slipd.tools.evaluation.run_figures import ALARMS, BY_SEVERITY, figures
from slipd.tools.parquet_library import parquet_library, storable, stored_schema

KEYS = ("recording", "config", "key", "version")
"""The first columns of a table."""

ROWS = 1000
"""Rows that are written at once."""


def write_table(path: Path, finished: Iterable[Finished], inputs: Iterable[Path] = ()) -> None:
    """Write a table; the file appears when it is complete, and replaces nothing but an earlier table.

    Args:
        path: The file.
        finished: The runs, in any order.
        inputs: What the command reads.

    Raises:
        SlipdError: pyarrow is not installed, or the file cannot be written or is something else.
    """
    arrow, parquet = parquet_library("--out", "batch")
    rows: Iterator[dict[str, Any]] = map(_row, finished)
    with (
        draft(path, TABLE, inputs, overwrite=True) as written,
        parquet.ParquetWriter(written, _schema(arrow), compression="zstd") as writer,
    ):
        while batch := list(islice(rows, ROWS)):
            writer.write_table(arrow.Table.from_pylist(batch, schema=_schema(arrow)))


def is_table(path: Path) -> bool:
    """Return whether a file is a table of this module, of any version: by the names of its first columns."""
    schema = stored_schema(path, "--out", "batch")
    return schema is not None and schema.names[: len(KEYS)] == list(KEYS)


TABLE = Kind("a table of slipd evaluate", is_table, replaceable=False)


def _row(found: Finished) -> dict[str, Any]:
    job, run = found.job, found.run
    names = {"recording": storable(str(job.path)), "config": storable(job.config.name)}
    row = names | {"key": job.key, "version": __version__}
    return row | ({"fault": storable(run)} if isinstance(run, str) else _run_columns(run))


def _run_columns(run: ConfigRun) -> dict[str, Any]:
    found = figures(run)
    alarms = [
        {"source": source, **span._asdict()}
        for source, spans in run.spans.items()
        for span in spans
        if span.level in ALARMS
    ]
    return {
        "fault": storable(run.fault) or None,
        "length_s": found.length_s,
        **{f"{level}_s": seconds for level, seconds in found.level_s.items()},
        "unknown_because": list(found.unknown_s.items()),
        "changes": found.changes,
        "warnings": found.warnings,
        "first_warning_s": found.first_warning_s,
        "alarms": alarms,
        "largest": None if run.largest is None else run.largest._asdict(),
        "streams": [stream._asdict() for stream in run.streams],
        "gaps": run.gaps,
        "compute_s": run.compute_s,
    }


def _schema(arrow: ModuleType) -> Any:
    text, number, count = arrow.string(), arrow.float64(), arrow.int64()
    interval = {"begin_s": number, "end_s": number}
    alarm = {"source": text, "level": text, **interval, "reasons": arrow.list_(text), "evidence": arrow.list_(text)}
    stream = {"stream": text} | dict.fromkeys(StreamHealth._fields[1:], count)
    columns = {
        **dict.fromkeys(KEYS, text),
        "fault": text,
        "length_s": number,
        **{f"{level}_s": number for level in BY_SEVERITY},
        "unknown_because": arrow.map_(text, number),
        "changes": count,
        "warnings": count,
        "first_warning_s": number,
        "alarms": arrow.list_(arrow.struct(alarm)),
        "largest": arrow.struct({"utilisation": number, "finger": text, "t_s": number}),
        "streams": arrow.list_(arrow.struct(stream)),
        "gaps": count,
        "compute_s": number,
    }
    return arrow.schema(columns)
