"""How what slipd reported compares with what truly happened in a simulated grasp."""

from __future__ import annotations

from slipd.tools.evaluation.config_run import Interval, Truth
from slipd.tools.evaluation.run_figures import RunFigures

SHORT_S = 0.0005
"""What is shorter than this is not said, s."""


def against_truth(truth: Truth, found: RunFigures) -> str:
    """Return in words how the alarms of a run compare with the first true slip, and what it reports without motion."""
    parts: list[str] = []
    if truth.sliding:
        begin_s, end_s = truth.sliding[0]
        if found.first_warning_s is None or found.first_warning_s > end_s:
            parts.append("the slip was not warned of")
        elif found.first_warning_s <= begin_s:
            parts.append(f"warned {begin_s - found.first_warning_s:.3f} s before the slip")
        else:
            parts.append(f"warned {found.first_warning_s - begin_s:.3f} s after the slip began")
        reported = [max(begin - begin_s, 0.0) for begin, end in found.slipping if end > begin_s and begin < end_s]
        parts.append(
            f"slipping reported {reported[0]:.3f} s after it began" if reported else "never reported as slipping"
        )
    elif found.warnings:
        parts.append(f"{found.warnings} warnings without a slip")
    else:
        parts.append("no slip and no warning")
    slid_s, reported_s = _length(truth.sliding), _length(found.slipping)
    both_s = sum(
        max(0.0, min(end, true_end) - max(begin, true_begin))
        for begin, end in found.slipping
        for true_begin, true_end in truth.sliding
    )
    if slid_s:
        parts.append(f"{both_s:.3f} s of {slid_s:.3f} s of sliding reported as slipping")
    if reported_s - both_s > SHORT_S:
        parts.append(f"slipping for {reported_s - both_s:.3f} s without motion")
    return "; ".join(parts)


def _length(found: list[Interval]) -> float:
    return sum(end - begin for begin, end in found)
