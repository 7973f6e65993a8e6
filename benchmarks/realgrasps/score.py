"""Compare what slipd reports on one trial with its label."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from realgrasps.labels import Label

from slipd.tools.evaluation.config_run import LevelSpan

ALARMS = frozenset({"warning", "slipping"})
SLIPPING = frozenset({"slipping"})
BEFORE_S = 0.5
"""An alarm that is raised up to this long before the object begins to move is about this slip."""

LEAD_S = 0.3
"""A drop counts as warned of with at least this much time left."""


@dataclass(frozen=True, slots=True)
class Alarm:
    """A time in which a source reported a level of a set."""

    source: str
    begin_s: float
    end_s: float
    evidence: tuple[str, ...]
    reasons: tuple[str, ...]

    def on_within(self, begin_s: float, end_s: float) -> bool:
        """Whether it is on at some time of this interval."""
        return self.begin_s <= end_s and self.end_s > begin_s and begin_s <= end_s

    def raised_within(self, begin_s: float, end_s: float) -> bool:
        """Whether it begins in this interval."""
        return begin_s <= self.begin_s <= end_s


@dataclass(frozen=True, slots=True)
class Reported:
    """What one set of levels says about one trial; None where the question does not arise.

    Attributes:
        by_onset: The slip was reported before the object had moved by 5 mm or 5°.
        by_far: Before 10 mm or 10°.
        by_onset_lax: As ``by_onset``, but any alarm since the grasp counts.
        by_far_lax: As ``by_far``, likewise.
        held_alarmed: There was an alarm while the object was held without moving.
        drop: The drop was warned of 0.3 s before.
        drop_lax: As ``drop``, but any alarm since the grasp counts.
        early: Alarms between the grasp and 0.5 s before the slip.
        early_s: How long such an alarm was on, s; alarms of two fingers at once count once.
        first_s: First alarm that counts as a report of the slip, s after its begin.
        evidence: Kinds of evidence that the alarms name which count, or those of a hold.
        reasons: Their reasons.
    """

    by_onset: bool | None = None
    by_far: bool | None = None
    by_onset_lax: bool | None = None
    by_far_lax: bool | None = None
    held_alarmed: bool | None = None
    drop: bool | None = None
    drop_lax: bool | None = None
    early: int | None = None
    early_s: float | None = None
    first_s: float | None = None
    evidence: tuple[str, ...] = ()
    reasons: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Trial:
    """One trial: its label, and what was reported.

    Attributes:
        label: The label.
        alarms: By level ``warning`` or ``slipping``.
        slipping: By level ``slipping`` alone.
        unknown_s: How long a finger or the grasp was "unknown" while the object was held, s.
        held_s: How long the object was held, s.
    """

    label: Label
    alarms: Reported
    slipping: Reported
    unknown_s: float
    held_s: float

    def as_map(self) -> dict[str, Any]:
        """Return all of it for JSON."""
        return asdict(self)


def score(label: Label, spans: Mapping[str, list[LevelSpan]]) -> Trial:
    """Compare the levels of every source of a run with the label of the trial."""
    unknown = union(_clipped(alarms_of(spans, frozenset({"unknown"})), label.grasp_s, label.end_s))
    return Trial(
        label,
        _reported(label, alarms_of(spans, ALARMS)),
        _reported(label, alarms_of(spans, SLIPPING)),
        unknown,
        label.end_s - label.grasp_s,
    )


def alarms_of(spans: Mapping[str, list[LevelSpan]], levels: frozenset[str]) -> list[Alarm]:
    """Return the times in which each source reports a level of a set, in order of their begin."""
    found: list[Alarm] = []
    for source, of_source in spans.items():
        open_: Alarm | None = None
        for span in of_source:
            if span.level not in levels:
                open_ = None
            elif open_ is None:
                open_ = Alarm(source, span.begin_s, span.end_s, span.evidence, span.reasons)
                found.append(open_)
            else:
                evidence, reasons = _merged(open_.evidence, span.evidence), _merged(open_.reasons, span.reasons)
                open_ = found[-1] = Alarm(source, open_.begin_s, span.end_s, evidence, reasons)
    return sorted(found, key=lambda alarm: alarm.begin_s)


def union(intervals: Iterable[tuple[float, float]]) -> float:
    """Return the length of the union of intervals, s."""
    total, reached = 0.0, float("-inf")
    for begin_s, end_s in sorted(intervals):
        total += max(0.0, end_s - max(begin_s, reached))
        reached = max(reached, end_s)
    return total


def _reported(label: Label, alarms: list[Alarm]) -> Reported:
    if label.kind == "unclear":
        return Reported()
    if label.begin_s is None or label.onset_s is None:
        held = [alarm for alarm in alarms if alarm.on_within(label.grasp_s, label.end_s)]
        return Reported(held_alarmed=bool(held), **_named(held))
    begin_s = label.begin_s
    last_s = label.far_s if label.far_s is not None else label.end_s
    counted = [alarm for alarm in alarms if _is_about(alarm, begin_s, last_s)]
    early = [alarm for alarm in alarms if alarm.on_within(label.grasp_s, begin_s - BEFORE_S)]
    return Reported(
        by_onset=_any_about(alarms, begin_s, label.onset_s),
        by_far=None if label.far_s is None else _any_about(alarms, begin_s, label.far_s),
        by_onset_lax=_any_on(alarms, label.grasp_s, label.onset_s),
        by_far_lax=None if label.far_s is None else _any_on(alarms, label.grasp_s, label.far_s),
        drop=_any_about(alarms, begin_s, label.end_s - LEAD_S) if label.dropped else None,
        drop_lax=_any_on(alarms, label.grasp_s, label.end_s - LEAD_S) if label.dropped else None,
        early=len(early),
        early_s=union(_clipped(early, label.grasp_s, begin_s - BEFORE_S)),
        first_s=min((alarm.begin_s - begin_s for alarm in counted), default=None),
        **_named(counted),
    )


def _is_about(alarm: Alarm, begin_s: float, by_s: float) -> bool:
    """Whether an alarm reports a slip that begins at ``begin_s``, by the time ``by_s``."""
    return alarm.on_within(begin_s, by_s) or alarm.raised_within(begin_s - BEFORE_S, min(begin_s, by_s))


def _any_about(alarms: list[Alarm], begin_s: float, by_s: float) -> bool:
    return any(_is_about(alarm, begin_s, by_s) for alarm in alarms)


def _any_on(alarms: list[Alarm], begin_s: float, end_s: float) -> bool:
    return any(alarm.on_within(begin_s, end_s) for alarm in alarms)


def _clipped(alarms: Iterable[Alarm], begin_s: float, end_s: float) -> list[tuple[float, float]]:
    return [(max(alarm.begin_s, begin_s), min(alarm.end_s, end_s)) for alarm in alarms]


def _named(alarms: list[Alarm]) -> dict[str, tuple[str, ...]]:
    evidence: tuple[str, ...] = ()
    reasons: tuple[str, ...] = ()
    for alarm in alarms:
        evidence, reasons = _merged(evidence, alarm.evidence), _merged(reasons, alarm.reasons)
    return {"evidence": evidence, "reasons": reasons}


def _merged(one: tuple[str, ...], other: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(one + other))
