"""The table of an evaluation, and what differs between configs, as text for people and as maps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from slipd.tools.evaluation.config_run import RECORDED, ConfigRun
from slipd.tools.evaluation.evaluate import Evaluation
from slipd.tools.evaluation.executors import Run
from slipd.tools.evaluation.run_figures import (
    BY_SEVERITY,
    Interval,
    RunFigures,
    differences,
    figures,
    worst_spans,
)

SHOWN = 4
"""Most intervals of one line; `as_map` has all."""

NOTHING = "-"
_HEAD = (
    "recording",
    "config",
    "length",
    *BY_SEVERITY,
    "changes",
    "warnings",
    "first",
    "slipping at",
    "λ max",
    "unknown because",
    "alarms name",
)
_LEFT = {"recording", "config", "slipping at", "unknown because", "alarms name"}


def table(evaluations: Sequence[Evaluation]) -> Iterator[str]:
    """Yield the lines of the table: one for each recording and config, times in s of the worse finger."""
    rows = [_HEAD, *(row for one in evaluations for row in _rows(one))]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = [
            cell.ljust(width) if name in _LEFT else cell.rjust(width)
            for name, cell, width in zip(_HEAD, row, widths, strict=True)
        ]
        yield "  ".join(cells).rstrip()


def comparisons(evaluations: Sequence[Evaluation]) -> Iterator[str]:
    """Yield what every other config changes against the recorded one."""
    for one in evaluations:
        recorded = one.runs[RECORDED]
        for name, run in one.runs.items():
            if isinstance(run, str):
                continue
            if isinstance(recorded, ConfigRun) and run is not recorded:
                yield from _compared(f"{one.name}, {name}", recorded, run)


def as_map(evaluations: Sequence[Evaluation]) -> list[dict[str, Any]]:
    """Return all of it, with the levels of every finger over time."""
    return [
        {
            "recording": str(one.path),
            "runs": {name: _run_map(one.runs[RECORDED], run) for name, run in one.runs.items()},
        }
        for one in evaluations
    ]


def _run_map(recorded: Run, run: Run) -> dict[str, Any]:
    if isinstance(run, str):
        return {"fault": run}
    before = [] if isinstance(recorded, str) else worst_spans(recorded.spans)
    return figures(run).as_map() | {
        "spans": {source: [span._asdict() for span in spans] for source, spans in run.spans.items()},
        "fault": run.fault,
        "differences": differences(before, worst_spans(run.spans)),
    }


def _rows(one: Evaluation) -> Iterator[tuple[str, ...]]:
    """Yield the rows of one recording; only the first names it."""
    name = one.name
    for config, run in one.runs.items():
        row = ("no run, see below",) if isinstance(run, str) else _figures(figures(run))
        yield (name, config, *row, *[""] * (len(_HEAD) - 2 - len(row)))
        name = ""


def _figures(found: RunFigures) -> tuple[str, ...]:
    unknown = sorted(found.unknown_s.items(), key=lambda item: -item[1])
    return (
        f"{found.length_s:.2f}",
        *(f"{found.level_s[level]:.2f}" if found.level_s[level] else NOTHING for level in BY_SEVERITY),
        str(found.changes),
        str(found.warnings),
        NOTHING if found.first_warning_s is None else f"{found.first_warning_s:.3f}",
        _times(found.slipping),
        NOTHING if found.largest is None else f"{found.largest.utilisation:.2f}",
        ", ".join(f"{reason} {seconds:.2f}" for reason, seconds in unknown) or NOTHING,
        ", ".join(found.named) or NOTHING,
    )


def _times(found: list[Interval]) -> str:
    shown = ", ".join(f"{begin_s:.2f}…{end_s:.2f}" for begin_s, end_s in found[:SHOWN]) or NOTHING
    return shown + (f" and {len(found) - SHOWN} more" if len(found) > SHOWN else "")


def _compared(name: str, recorded: ConfigRun, run: ConfigRun) -> Iterator[str]:
    if recorded.spans and not run.spans:
        yield f"{name}: no levels; the sensors of a config must be those of the recording"
        return
    found = differences(worst_spans(recorded.spans), worst_spans(run.spans))
    if not found:
        yield f"{name}: the same levels as {RECORDED}"
        return
    before, after = figures(recorded), figures(run)
    seconds = sum(end_s - begin_s for begin_s, end_s, _, _ in found)
    yield (
        f"{name}: other levels than {RECORDED} for {seconds:.2f} s; changes {_change(before.changes, after.changes)}, "
        f"warnings {_change(before.warnings, after.warnings)}, "
        f"first warning at {_change(before.first_warning_s, after.first_warning_s)} s"
    )
    longest = sorted(found, key=lambda one: one[0] - one[1])[:SHOWN]
    for begin_s, end_s, was, now in sorted(longest):
        yield f"    {begin_s:8.3f}…{end_s:.3f} s  {was} → {now}"
    if len(found) > SHOWN:
        yield f"    and {len(found) - SHOWN} shorter times"


def _change(before: float | None, after: float | None) -> str:
    """Return a figure before and after."""
    was, now = ("none" if value is None else f"{round(value, 3):g}" for value in (before, after))
    return f"{was} as before" if was == now else f"{was} → {now}"
