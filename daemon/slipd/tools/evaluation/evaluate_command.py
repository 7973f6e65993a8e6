"""The command ``slipd evaluate``: a table for a person, one JSON list, or a Parquet file of many recordings.

The table has a row for each recording and config; below it stands what each config changes against the recorded one.
"""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from slipd.errors import printable
from slipd.io.progress import Progress
from slipd.tools.cli_arguments import aligned, chosen
from slipd.tools.evaluation.config_run import RECORDED, ConfigRun, joined
from slipd.tools.evaluation.evaluate import (
    Evaluation,
    ResultCache,
    cache_folder,
    evaluations,
    finished_runs,
    short_names,
)
from slipd.tools.evaluation.executors import Finished, NamedConfig, Run, on_dask
from slipd.tools.evaluation.run_figures import (
    BY_SEVERITY,
    Interval,
    RunFigures,
    differences,
    figures,
    worst_spans,
    write_table,
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
_RIGHT = {number for number, name in enumerate(_HEAD) if name not in _LEFT}


def table(evaluations: Sequence[Evaluation]) -> list[str]:
    """Return the lines of the table: one for each recording and config, times in s of the worse finger."""
    return aligned([_HEAD, *(row for one in evaluations for row in _rows(one))], _RIGHT)


def comparisons(evaluations: Sequence[Evaluation]) -> Iterator[str]:
    """Yield what every other config changes against the recorded one."""
    for one in evaluations:
        recorded = one.runs[RECORDED]
        for name, run in one.runs.items():
            if isinstance(recorded, ConfigRun) and isinstance(run, ConfigRun) and run is not recorded:
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
    return asdict(figures(run)) | {
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
        f"first warning {_change(before.first_warning_s, after.first_warning_s, ' s')}"
    )
    longest = sorted(found, key=lambda one: one[0] - one[1])[:SHOWN]
    for begin_s, end_s, was, now in sorted(longest):
        yield f"    {begin_s:8.3f}…{end_s:.3f} s  {was} → {now}"
    if len(found) > SHOWN:
        yield f"    and {len(found) - SHOWN} shorter times"


def _change(before: float | None, after: float | None, unit: str = "") -> str:
    """Return a figure before and after."""
    was, now = ("none" if value is None else f"{round(value, 3):g}{unit}" for value in (before, after))
    return f"{was} as before" if was == now else f"{was} → {now}"


SHOWN_FAULTS = 20
"""Most faults that are printed beside a Parquet file, which has all of them."""


def evaluate_command(
    recordings: Sequence[Path],
    config: Sequence[Path],
    *,
    shard: tuple[int, int],
    dask: str | None,
    results: Path | None,
    out: Path | None,
    as_json: bool,
) -> bool:
    """Replay recordings with several configs, and print or write what each reported.

    Args:
        recordings: The recordings, or folders of them.
        config: Configs to replay them with, beside that of each recording.
        shard: Which share of the recordings is replayed: its number, and how many there are.
        dask: Address of the Dask scheduler on whose workers the replays run; None: on all cores of this machine.
        results: Folder that keeps all results; None: the cache, which keeps the newest.
        out: A Parquet file with one row for each recording and config; None: print a table.
        as_json: Print one JSON list instead of the table.

    Returns:
        Whether every recording is complete, was replayed with every config, and gave the same levels with each.

    Raises:
        ConfigError: A config cannot be read or has faults.
        SlipdError: pyarrow or Dask is not installed, no scheduler answers, or the file cannot be written.
    """
    paths = chosen(recordings, shard)
    cache = ResultCache(cache_folder()) if results is None else ResultCache(results, pruned=False)
    executor = None if dask is None else on_dask(dask)
    named = _named(list(dict.fromkeys(config)))
    of = len(paths) * (1 + len(named))
    begun_s = time.monotonic()
    progress = Progress(lambda done, of: f"{done} of {of} runs, {time.monotonic() - begun_s:.0f} s")
    totals = _Totals()
    with (
        progress.shown() as show,
        contextlib.closing(finished_runs(paths, named, cache, executor)) as runs,
    ):
        show(0, of)
        counted = totals.counted(runs, lambda done: show(done, of))
        if out is None:
            found = evaluations(counted, paths, named)
            faults = list(dict.fromkeys(fault for one in found for fault in one.faults))
        else:
            write_table(out, counted, [*paths, *config])
            faults = list(totals.faults)
    if out is not None:
        print(f"{out}: {totals.count['runs']} runs of {len(paths)} recordings, {totals}")
    elif as_json:
        print(json.dumps(as_map(found), ensure_ascii=False, allow_nan=False))
    else:
        compared = list(comparisons(found))
        for line in [*table(found), *([""] if compared else []), *compared]:
            print(printable(line))
    for fault in faults:
        print(f"slipd: {printable(fault)}", file=sys.stderr)
    return not faults and not totals.differ


class _Totals:
    """What all runs have in common.

    Attributes:
        count: Number of runs, and of those that an earlier evaluation kept, that failed, and that have an alarm.
        compute_s: Processor time of all replays, the kept ones included.
        faults: The first distinct faults, for people.
        differ: A config gave other levels than another.
    """

    def __init__(self) -> None:
        self.count: Counter[str] = Counter()
        self.compute_s = 0.0
        self.faults: dict[str, None] = {}
        self.differ = False
        self._levels: dict[Path, int] = {}

    def __str__(self) -> str:
        count = self.count
        known = f"{count['kept']} of them known before, {count['failed']} failed, {count['warned']} with an alarm"
        return f"{known}; {self.compute_s:.1f} s of computing"

    def counted(self, runs: Iterable[Finished], show: Callable[[int], None]) -> Iterator[Finished]:
        """Yield the runs, and count them."""
        for found in runs:
            self.count.update({"runs": 1, "kept": int(found.kept), "failed": int(isinstance(found.run, str))})
            show(self.count["runs"])
            fault = found.run if isinstance(found.run, str) else found.run.fault
            if fault and len(self.faults) < SHOWN_FAULTS:
                self.faults[fault] = None
            if isinstance(found.run, ConfigRun):
                self.compute_s += found.run.compute_s
                self.count["warned"] += bool(figures(found.run).warnings)
                levels = _levels(found.run)
                self.differ = self.differ or self._levels.setdefault(found.job.path, levels) != levels
            yield found


def _levels(run: ConfigRun) -> int:
    """Return a number that is the same for runs of the same levels at the same times."""
    levels = joined((span.begin_s, span.end_s, span.level) for span in worst_spans(run.spans))
    return hash(tuple((level, begin_s) for begin_s, _, level in levels))


def _named(paths: list[Path]) -> list[NamedConfig]:
    if not paths:
        return []
    from slipd import config  # here: only a config that is given needs the models of its tables

    names = [f"./{name}" if name == RECORDED else name for name in short_names(paths)]
    return [NamedConfig(name, config.load(path).text) for name, path in zip(names, paths, strict=True)]
