"""The figures of all trials, as text and as a map."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

from realgrasps.score import Reported, Trial

QUESTIONS: dict[str, str] = {
    "by_onset": "slips reported by 5 mm or 5°",
    "by_far": "slips reported by 10 mm or 10°",
    "by_onset_lax": "by 5 mm, any alarm since the grasp",
    "by_far_lax": "by 10 mm, any alarm since the grasp",
    "drop": "drops warned of 0.3 s before",
    "drop_lax": "drops, any alarm since the grasp",
    "held_alarmed": "holds alarmed",
}
"""Answers that are counted, and what they are called."""

LEVELS: dict[str, Callable[[Trial], Reported]] = {
    "warning or slipping": lambda trial: trial.alarms,
    "slipping": lambda trial: trial.slipping,
}


def totals(trials: list[Trial]) -> dict[str, Any]:
    """Return every count as [yes, of how many], by level; with early alarms, and the evidence that was named."""
    found: dict[str, Any] = {}
    for levels, part in LEVELS.items():
        reports = [part(trial) for trial in trials]
        counts: dict[str, Any] = {name: _share(reports, name) for name in QUESTIONS}
        slips = [report for report in reports if report.early is not None]
        counts["slips_alarmed_early"] = [sum(report.early > 0 for report in slips), len(slips)]
        counts["early_alarms"] = sum(report.early or 0 for report in slips)
        counts["early_s"] = round(sum(report.early_s or 0.0 for report in slips), 2)
        counts["evidence"] = dict(Counter(kind for report in slips for kind in report.evidence))
        counts["reasons"] = dict(Counter(reason for report in slips for reason in report.reasons))
        held = [report for report in reports if report.held_alarmed]
        counts["hold_evidence"] = dict(Counter(kind for report in held for kind in report.evidence))
        counts["hold_reasons"] = dict(Counter(reason for report in held for reason in report.reasons))
        found[levels] = counts
    found["held_s"] = round(sum(trial.held_s for trial in trials), 2)
    found["unknown_s"] = round(sum(trial.unknown_s for trial in trials), 2)
    found["early_of_s"] = round(
        sum(trial.label.begin_s - trial.label.grasp_s for trial in trials if trial.label.begin_s is not None), 2
    )
    return found


def _share(reports: list[Reported], name: str) -> list[int]:
    answers = [answer for report in reports if (answer := getattr(report, name)) is not None]
    return [sum(answers), len(answers)]


def lines(trials: list[Trial]) -> Iterator[str]:
    """Yield the report, line by line."""
    yield (
        f"{'trial':<20} {'object':<8} {'kind':<8} {'5 mm':<5} {'10 mm':<6} {'drop':<5} {'slipping':<9} "
        f"{'first s':>8} {'early':>6}  evidence; reasons"
    )
    for trial in trials:
        yield _line(trial)
    found = totals(trials)
    for levels in LEVELS:
        yield ""
        yield f"level {levels}:"
        yield from _counted(found[levels], found["early_of_s"])
    yield ""
    yield f"unknown while held: {found['unknown_s']} s of {found['held_s']} s"


def _counted(counts: dict[str, Any], early_of_s: float) -> Iterator[str]:
    for name, text in QUESTIONS.items():
        yield f"  {text:<40} {_of(counts[name])}"
    yield f"  {'slips with an early alarm':<40} {_of(counts['slips_alarmed_early'])}"
    early = f"{counts['early_alarms']}, on for {counts['early_s']} s of {early_of_s} s"
    yield f"  {'early alarms':<40} {early}"
    for key, text in (("evidence", "slips, evidence named"), ("reasons", "slips, reasons named")):
        yield f"  {text:<40} {_words(counts[key])}"
    for key, text in (("hold_evidence", "holds, evidence named"), ("hold_reasons", "holds, reasons named")):
        yield f"  {text:<40} {_words(counts[key])}"


def _line(trial: Trial) -> str:
    label, alarms, slipping = trial.label, trial.alarms, trial.slipping
    kind = "drop" if label.kind == "slip" and label.dropped else label.kind
    if label.kind == "hold":
        verdict = "alarmed" if alarms.held_alarmed else "quiet"
        told = f"{verdict:<18} {'alarmed' if slipping.held_alarmed else 'quiet':<9}"
    elif label.kind == "slip":
        marks = map(_mark, (alarms.by_onset, alarms.by_far, alarms.drop))
        told = "{:<5} {:<6} {:<5} ".format(*marks) + f"{_mark(slipping.by_onset):<9}"
    else:
        told = ""
    first = "" if alarms.first_s is None else f"{alarms.first_s:+.2f}"
    early = "" if alarms.early is None else str(alarms.early)
    named = "; ".join(filter(None, (" ".join(alarms.evidence), " ".join(alarms.reasons))))
    return f"{label.name:<20} {label.thing:<8} {kind:<8} {told:<28} {first:>8} {early:>6}  {named}".rstrip()


def _mark(answer: bool | None) -> str:
    return "–" if answer is None else "yes" if answer else "no"


def _of(counts: list[int]) -> str:
    yes, of = counts
    return f"{yes} of {of}" + (f", {yes / of:.0%}" if of else "")


def _words(counts: dict[str, int]) -> str:
    return ", ".join(f"{word} {count}" for word, count in sorted(counts.items(), key=lambda item: -item[1])) or "none"
