"""What a user compares about a run: time at each level, changes, alarms, and the worse finger; also as a table.

A table is a Parquet file with one row for each recording and config. Rows are written as runs finish, in any order, so
the file needs no more memory for a million runs than for a thousand.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from itertools import islice, pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

from slipd import __version__
from slipd.tools.evaluation.config_run import ConfigRun, Largest, LevelSpan, StreamHealth, joined
from slipd.tools.evaluation.executors import Finished
from slipd.tools.outputs import Kind, draft, parquet_library, storable, stored_schema
from slipd_client.messages import GRASP_TOPIC, SEVERITY

ALARMS = ("warning", "slipping")
BY_SEVERITY = sorted(SEVERITY, key=lambda level: SEVERITY[level])

Interval = tuple[float, float]
"""Begin and end, s."""


@dataclass(frozen=True, slots=True)
class RunFigures:
    """Figures of one run. Times are seconds since the first event of the recording.

    Attributes:
        length_s: Time of the last event.
        level_s: Time at each level, of the worse finger.
        changes: Changes of level, of all fingers together.
        warnings: How often a finger rose to ``warning`` or ``slipping`` from a level below both.
        first_warning_s: When the first finger did; None if none did.
        alarms: When any finger reported ``warning`` or ``slipping``.
        slipping: When any finger reported ``slipping``.
        unknown_s: Time at ``unknown`` by its most important reason.
        largest: Largest utilisation; None where none was known.
        named: Reasons and kinds of evidence that alarms name.
    """

    length_s: float
    level_s: dict[str, float]
    changes: int
    warnings: int
    first_warning_s: float | None
    alarms: list[Interval]
    slipping: list[Interval]
    unknown_s: dict[str, float]
    largest: Largest | None
    named: list[str]


def figures(run: ConfigRun) -> RunFigures:
    """Return the figures of a run."""
    fingers = [spans for source, spans in run.spans.items() if source != GRASP_TOPIC]
    worst = worst_spans(run.spans)
    level_s = dict.fromkeys(BY_SEVERITY, 0.0)
    unknown_s: dict[str, float] = {}
    for span in worst:
        level_s[span.level] += span.seconds
        if span.level == "unknown":
            reason = span.reasons[0] if span.reasons else "no reason"
            unknown_s[reason] = unknown_s.get(reason, 0.0) + span.seconds
    rises_s = [begin_s for spans in fingers for begin_s, _ in intervals(spans, ALARMS)]
    alarms = [span for spans in fingers for span in spans if span.level in ALARMS]
    return RunFigures(
        length_s=run.end_s,
        level_s=level_s,
        changes=sum(one.level != other.level for spans in fingers for one, other in pairwise(spans)),
        warnings=len(rises_s),
        first_warning_s=min(rises_s, default=None),
        alarms=intervals(worst, ALARMS),
        slipping=intervals(worst, ("slipping",)),
        unknown_s=unknown_s,
        largest=run.largest,
        named=list(dict.fromkeys(word for span in alarms for word in span.reasons + span.evidence)),
    )


def intervals(spans: Iterable[LevelSpan], levels: tuple[str, ...]) -> list[Interval]:
    """Return the times at any of some levels; spans that follow each other are one."""
    at = joined((span.begin_s, span.end_s, None) for span in spans if span.level in levels)
    return [(begin_s, end_s) for begin_s, end_s, _ in at]


def worst_spans(spans: Mapping[str, list[LevelSpan]]) -> list[LevelSpan]:
    """Return the level of the worse finger over time, with the reasons of every finger at that level."""
    fingers = [row for source, row in spans.items() if source != GRASP_TOPIC]
    states = joined((begin_s, end_s, _worst(now)) for begin_s, end_s, now in _together(fingers))
    return [LevelSpan(*state, begin_s, end_s) for begin_s, end_s, state in states]


def _worst(now: list[LevelSpan]) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Return the worst of some levels, with the reasons and the evidence of all that are at it."""
    level = max((span.level for span in now), key=SEVERITY.__getitem__)
    worse = [span for span in now if span.level == level]
    reasons = dict.fromkeys(reason for span in worse for reason in span.reasons)
    evidence = dict.fromkeys(kind for span in worse for kind in span.evidence)
    return level, tuple(reasons), tuple(evidence)


def differences(before: list[LevelSpan], after: list[LevelSpan]) -> list[tuple[float, float, str, str]]:
    """Return when the levels of two runs differ: begin and end, s, and both levels."""
    both = _together([before, after])
    levels = joined((begin_s, end_s, (now[0].level, now[-1].level)) for begin_s, end_s, now in both)
    return [(begin_s, end_s, was, now) for begin_s, end_s, (was, now) in levels if was != now]


def _together(rows: list[list[LevelSpan]]) -> Iterator[tuple[float, float, list[LevelSpan]]]:
    """Yield begin, end and the spans of every row, for each time in which no row changes."""
    times_s = sorted({time_s for spans in rows for span in spans for time_s in (span.begin_s, span.end_s)})
    at = [0] * len(rows)
    for begin_s, end_s in pairwise(times_s):
        now = []
        for row, spans in enumerate(rows):
            while at[row] < len(spans) and spans[at[row]].end_s <= begin_s:
                at[row] += 1
            if at[row] < len(spans) and spans[at[row]].begin_s <= begin_s:
                now.append(spans[at[row]])
        if now:
            yield begin_s, end_s, now


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
    if isinstance(run, str):
        return row | {"fault": storable(run)}
    values = figures(run)
    alarms = [
        {"source": source, **span._asdict()}
        for source, spans in run.spans.items()
        for span in spans
        if span.level in ALARMS
    ]
    return row | {
        "fault": storable(run.fault) or None,
        "length_s": values.length_s,
        **{f"{level}_s": seconds for level, seconds in values.level_s.items()},
        "unknown_because": list(values.unknown_s.items()),
        "changes": values.changes,
        "warnings": values.warnings,
        "first_warning_s": values.first_warning_s,
        "alarms": alarms,
        "largest": None if run.largest is None else asdict(run.largest),
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
