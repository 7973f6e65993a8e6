"""What truly happened in a recording of a simulated grasp."""

from __future__ import annotations

from typing import NamedTuple

from slipd.errors import RecordingError
from slipd.recording.entry_walk import Published
from slipd.recording.reader import Recording
from slipd.tools.evaluation.config_run import Interval, Truth
from slipd.tools.sim.truth_log import TRUTH
from slipd_client.messages import MessageError, decode


class Outline(NamedTuple):
    """Times of the first and last event, CLOCK_MONOTONIC, s, and the truth; None where a recording has none."""

    begin_s: float
    end_s: float
    truth: Truth | None


def outline(recording: Recording) -> Outline:
    """Return how long a recording is, and what truly happened in it.

    Raises:
        RecordingError: The file cannot be read, or its truth is malformed.
    """
    first_ns = last_ns = None
    told: list[tuple[int, bool, float | None]] = []
    for entry in recording.entries():
        first_ns = entry.t_ns if first_ns is None else first_ns
        last_ns = entry.t_ns
        if isinstance(entry, Published) and entry.topic == TRUTH:
            try:
                told.append((entry.t_ns, *_told(entry.payload)))
            except (MessageError, KeyError, TypeError, ValueError) as error:
                text = f"{recording.path}: entry {entry.n} is no truth of a simulated grasp: {error}"
                raise RecordingError(text) from error
    if first_ns is None or last_ns is None:
        return Outline(0.0, 0.0, None)
    return Outline(first_ns * 1e-9, last_ns * 1e-9, _truth(told, first_ns, last_ns) if told else None)


def _truth(told: list[tuple[int, bool, float | None]], first_ns: int, last_ns: int) -> Truth:
    sliding: list[Interval] = []
    since_ns: int | None = None
    for t_ns, slides, _ in [*told, (last_ns, False, None)]:
        if slides and since_ns is None:
            since_ns = t_ns
        elif not slides and since_ns is not None:
            sliding.append(((since_ns - first_ns) * 1e-9, (t_ns - first_ns) * 1e-9))
            since_ns = None
    return Truth(sliding, max(used or 0.0 for _, _, used in told))


def _told(payload: bytes) -> tuple[bool, float | None]:
    found = decode(payload)
    used = found["utilisation"]
    return bool(found["sliding"]), None if used is None else float(used)
