"""What a user compares about a run: time at each level, changes, alarms, the worse finger, and the true slips."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

from slipd.tools.evaluation.config_replay import ConfigRun, Interval, Largest
from slipd.tools.evaluation.level_spans import LevelSpan
from slipd_client.messages import GRASP_TOPIC, SEVERITY

ALARMS = ("warning", "slipping")
BY_SEVERITY = sorted(SEVERITY, key=lambda level: SEVERITY[level])

IN_TIME_S = 1.0
"""An alarm that ended is a warning of a slip within this time, s: the load of a grip that slips wavers about the
threshold. One that ended before that was false, whatever follows later."""

SHORT_S = 0.0005
"""What is shorter than this is not said, s."""


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


def against_truth(sliding: list[Interval], found: RunFigures) -> str:
    """Return in words how the alarms of a run compare with the first true slip, and which had no slip."""
    parts: list[str] = []
    for begin_s, end_s in sliding[:1]:
        in_time_s = [begin for begin, end in found.alarms if end >= begin_s - IN_TIME_S and begin <= end_s]
        if not in_time_s:
            parts.append("the slip was not warned of")
        elif in_time_s[0] <= begin_s:
            parts.append(f"warned {begin_s - in_time_s[0]:.3f} s before the slip")
        else:
            parts.append(f"warned {in_time_s[0] - begin_s:.3f} s after the slip began")
        reported_s = [max(begin - begin_s, 0.0) for begin, end in found.slipping if end > begin_s and begin < end_s]
        parts.append(
            f"slipping reported {reported_s[0]:.3f} s after it began" if reported_s else "never reported as slipping"
        )
    false = sum(
        not any(begin <= slid_until and end >= slides - IN_TIME_S for slides, slid_until in sliding)
        for begin, end in found.alarms
    )
    if false:
        parts.append(f"{false} warnings without a slip")
    elif not sliding:
        parts.append("no slip and no warning")
    slid_s, slipping_s = _length(sliding), _length(found.slipping)
    both_s = sum(
        max(0.0, min(end, true_end) - max(begin, true_begin))
        for begin, end in found.slipping
        for true_begin, true_end in sliding
    )
    if sliding:
        parts.append(f"{both_s:.3f} s of {slid_s:.3f} s of sliding reported as slipping")
    if slipping_s - both_s > SHORT_S:
        parts.append(f"slipping for {slipping_s - both_s:.3f} s without motion")
    return "; ".join(parts)


def _length(found: list[Interval]) -> float:
    return sum(end - begin for begin, end in found)
