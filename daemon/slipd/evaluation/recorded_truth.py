"""What truly happened in a recording of a simulated grasp, and how a run compares with it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from slipd.errors import RecordingError
from slipd.evaluation.run_figures import Interval, RunFigures
from slipd.recording.reader import Published, open_recording
from slipd.sim.truth_log import TRUTH
from slipd_client.messages import MessageError, decode

SHORT_S = 0.0005
"""What is shorter than this is not said, s."""


@dataclass(frozen=True, slots=True)
class Truth:
    """What truly happened; times are seconds since the first event of the recording.

    Attributes:
        sliding: When the object slid as a whole.
        utilisation: Largest true utilisation, 1 slips.
    """

    sliding: list[Interval]
    utilisation: float

    def as_map(self) -> dict[str, Any]:
        """Return all of it as maps and lists."""
        return asdict(self)


def read_truth(path: Path) -> Truth | None:
    """Return the truth of a recording; None where it has none, as that of a live run.

    Raises:
        RecordingError: The file cannot be read, or its truth is none.
    """
    begin_ns: int | None = None
    sliding: list[Interval] = []
    largest: float | None = None
    since_s: float | None = None
    t_s = 0.0
    for entry in open_recording(path).entries():
        begin_ns = entry.t_ns if begin_ns is None else begin_ns
        t_s = (entry.t_ns - begin_ns) * 1e-9
        if not isinstance(entry, Published) or entry.topic != TRUTH:
            continue
        try:
            slides, used = _entry(entry.payload)
        except (MessageError, KeyError, TypeError, ValueError) as error:
            raise RecordingError(f"{path}: entry {entry.n} is no truth of a simulated grasp: {error}") from error
        largest = max(largest or 0.0, used or 0.0)
        if slides and since_s is None:
            since_s = t_s
        elif not slides and since_s is not None:
            sliding.append((since_s, t_s))
            since_s = None
    if since_s is not None:
        sliding.append((since_s, t_s))
    return None if largest is None else Truth(sliding, largest)


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


def _entry(payload: bytes) -> tuple[bool, float | None]:
    found = decode(payload)
    used = found["utilisation"]
    return bool(found["sliding"]), None if used is None else float(used)
