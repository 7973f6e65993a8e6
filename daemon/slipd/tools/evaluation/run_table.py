"""A Parquet file with one row for each recording and config: levels, alarms, health of the streams, compute time.

Rows are written as runs finish, in any order, so the file needs no more memory for a million runs than for a thousand.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

from slipd import __version__
from slipd.tools.draft import Kind, draft
from slipd.tools.evaluation.config_run import ConfigRun
from slipd.tools.evaluation.jobs import Finished
from slipd.tools.evaluation.run_figures import ALARMS, BY_SEVERITY, figures
from slipd.tools.parquet_library import parquet_library, storable

KEYS = ("recording", "config", "key", "version")
"""The first columns of a table."""

ROWS = 1000
"""Rows that are written at once."""


@dataclass(slots=True)
class TableTotals:
    """What a table holds.

    Attributes:
        runs: Rows.
        kept: Runs whose result an earlier evaluation kept.
        without_run: Rows of recordings that could not be replayed.
        warned: Runs with an alarm.
        compute_s: Processor time of all replays, the kept ones included.
        faults: The first distinct faults, for people; the table has all.
    """

    runs: int = 0
    kept: int = 0
    without_run: int = 0
    warned: int = 0
    compute_s: float = 0.0
    faults: dict[str, None] = field(default_factory=dict)

    def add(self, found: Finished, most_faults: int) -> None:
        """Count one more run."""
        self.runs += 1
        self.kept += found.kept
        fault = found.run if isinstance(found.run, str) else found.run.fault
        if fault and len(self.faults) < most_faults:
            self.faults[fault] = None
        if isinstance(found.run, str):
            self.without_run += 1
            return
        self.compute_s += found.run.compute_s
        self.warned += any(span.level in ALARMS for spans in found.run.spans.values() for span in spans)


def write_table(path: Path, finished: Iterable[Finished], most_faults: int) -> TableTotals:
    """Write a table; the file appears when it is complete, and replaces nothing but an earlier table.

    Raises:
        SlipdError: pyarrow is not installed, or the file cannot be written or is something else.
    """
    arrow, parquet = parquet_library("--table", "batch")
    totals = TableTotals()
    with (
        draft(path, TABLE, overwrite=True) as written,
        parquet.ParquetWriter(written, _schema(arrow), compression="zstd") as writer,
    ):
        for rows in _batches(finished, totals, most_faults):
            writer.write_table(arrow.Table.from_pylist(rows, schema=_schema(arrow)))
    return totals


def is_table(path: Path) -> bool:
    """Return whether a file is a table of this module, of any version: by the names of its first columns."""
    arrow, parquet = parquet_library("--table", "batch")
    try:
        names = parquet.read_schema(path).names
    except (OSError, arrow.ArrowInvalid):
        return False
    return bool(names[: len(KEYS)] == list(KEYS))


TABLE = Kind("a table of slipd evaluate", is_table, replaceable=False)


def _batches(finished: Iterable[Finished], totals: TableTotals, most_faults: int) -> Iterator[list[dict[str, Any]]]:
    rows: list[dict[str, Any]] = []
    for found in finished:
        totals.add(found, most_faults)
        rows.append(_row(found))
        if len(rows) == ROWS:
            yield rows
            rows = []
    if rows:
        yield rows


def _row(found: Finished) -> dict[str, Any]:
    job, run = found.job, found.run
    names = {"recording": storable(str(job.path)), "config": storable(job.config.name)}
    row = names | {"key": job.key, "version": __version__}
    if isinstance(run, str):
        return row | {"fault": storable(run)}
    return row | _run_columns(run)


def _run_columns(run: ConfigRun) -> dict[str, Any]:
    found = figures(run)
    alarms = [
        {"source": source, "level": span.level, "begin_s": span.begin_s, "end_s": span.end_s}
        | {"reasons": span.reasons, "evidence": span.evidence}
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
        "largest": None if run.largest is None else asdict(run.largest),
        "true_sliding": None if run.truth is None else [_interval(one) for one in run.truth.sliding],
        "true_utilisation": None if run.truth is None else run.truth.utilisation,
        "streams": [asdict(stream) for stream in run.streams],
        "gaps": run.gaps,
        "compute_s": run.compute_s,
    }


def _interval(found: tuple[float, float]) -> dict[str, float]:
    return {"begin_s": found[0], "end_s": found[1]}


def _schema(arrow: ModuleType) -> Any:
    text, number, count = arrow.string(), arrow.float64(), arrow.int64()
    interval = {"begin_s": number, "end_s": number}
    alarm = {"source": text, "level": text, **interval, "reasons": arrow.list_(text), "evidence": arrow.list_(text)}
    stream = {"stream": text} | dict.fromkeys(("health", "samples", "bad", "lost", "dropped", "reconnects"), count)
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
        "true_sliding": arrow.list_(arrow.struct(interval)),
        "true_utilisation": number,
        "streams": arrow.list_(arrow.struct(stream)),
        "gaps": count,
        "compute_s": number,
    }
    return arrow.schema(columns)
