"""What a user compares about a run: time at each level, changes, alarms, and the worse finger."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

from slipd.tools.evaluation.config_run import ConfigRun, Largest, LevelSpan
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

    def as_map(self) -> dict[str, Any]:
        """Return all of it as maps and lists."""
        return asdict(self) | {"largest": None if self.largest is None else self.largest._asdict()}


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
    found: list[Interval] = []
    for span in spans:
        if span.level not in levels:
            continue
        begin_s = found.pop()[0] if found and found[-1][1] == span.begin_s else span.begin_s
        found.append((begin_s, span.end_s))
    return found


def worst_spans(spans: Mapping[str, list[LevelSpan]]) -> list[LevelSpan]:
    """Return the level of the worse finger over time, with the reasons of every finger at that level."""
    found: list[LevelSpan] = []
    for begin_s, end_s, now in _together([row for source, row in spans.items() if source != GRASP_TOPIC]):
        level = max((span.level for span in now), key=SEVERITY.__getitem__)
        worse = [span for span in now if span.level == level]
        reasons = tuple(dict.fromkeys(reason for span in worse for reason in span.reasons))
        evidence = tuple(dict.fromkeys(kind for span in worse for kind in span.evidence))
        if found and found[-1][:3] == (level, reasons, evidence) and found[-1].end_s == begin_s:
            begin_s = found.pop().begin_s
        found.append(LevelSpan(level, reasons, evidence, begin_s, end_s))
    return found


def differences(before: list[LevelSpan], after: list[LevelSpan]) -> list[tuple[float, float, str, str]]:
    """Return when the levels of two runs differ: begin and end, s, and both levels."""
    found: list[tuple[float, float, str, str]] = []
    for begin_s, end_s, now in _together([before, after]):
        if len(now) < 2 or now[0].level == now[1].level:
            continue
        levels = now[0].level, now[1].level
        if found and found[-1][1] == begin_s and found[-1][2:] == levels:
            begin_s = found.pop()[0]
        found.append((begin_s, end_s, *levels))
    return found


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
