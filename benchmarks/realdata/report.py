"""The figures of all runs, as tables in Markdown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
from realdata.runs import Run
from realdata.score import Onset, Score

HEAD = (
    "| | onsets in time | late, ms: median / worst | late, mm | slides never reported | sliding reported "
    "| rest reported | clear rests with a report | pressed rests with one |"
)
RULE = "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"


def lines(runs: list[Run]) -> Iterator[str]:
    """Yield the tables of all runs together, and of each."""
    yield from (HEAD, RULE)
    for name in runs[0].scores:
        yield _row(name, [run.scores[name] for run in runs])
    yield from (
        "",
        "| run | slides | onsets in time: " + ", ".join(runs[0].scores) + " | λ at onset | μ learned / plateau |",
    )
    yield "| --- | --- | --- | --- | --- |"
    for run in runs:
        timely = ", ".join(str(sum(onset.in_time for onset in each.onsets)) for each in run.scores.values())
        low, middle, high = np.quantile(run.at_onset, (0.0, 0.5, 1.0))
        yield (
            f"| {run.name} | {len(run.motion.slides)} | {timely} | {middle:.2f} ({low:.2f} to {high:.2f}) "
            f"| {run.learned:.2f} |"
        )
    evidence: Counter[str] = sum((Counter(run.evidence) for run in runs), Counter())
    named = ", ".join(f"{kind} {count}" for kind, count in evidence.most_common())
    yield from ("", f"Evidence named by `slipping`: {named or 'none'}.")


def _row(name: str, scores: list[Score]) -> str:
    onsets = [onset for score in scores for onset in score.onsets]
    rested, false = sum(score.rested_s for score in scores), sum(score.false_s for score in scores)
    slid, reported = sum(score.slid_s for score in scores), sum(score.reported_s for score in scores)
    rests = [
        " of ".join(str(sum(getattr(score, kind)[part] for score in scores)) for part in (1, 0))
        for kind in ("clear", "pressed")
    ]
    cells = [
        f"{sum(onset.in_time for onset in onsets)} of {len(onsets)}",
        *_late(onsets),
        str(sum(onset.late_s is None for onset in onsets)),
        f"{reported / slid:.0%} of {slid:.0f} s",
        f"{false / rested:.0%} of {rested:.0f} s",
        *rests,
    ]
    return f"| {name} | " + " | ".join(cells) + " |"


def _late(onsets: list[Onset]) -> tuple[str, str]:
    known = [(onset.late_s, onset.late_m) for onset in onsets if onset.late_s is not None and onset.late_m is not None]
    if not known:
        return "none", "none"
    late_ms, late_mm = 1e3 * np.array(known).T
    return f"{np.median(late_ms):.0f} / {late_ms.max():.0f}", f"{np.median(late_mm):.1f} / {late_mm.max():.1f}"
