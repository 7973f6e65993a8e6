"""What truly happened in a recording of a simulated grasp."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

from slipd.errors import RecordingError
from slipd.recording.entry_walk import Published
from slipd.recording.reader import Recording
from slipd.sim.truth_log import TRUTH
from slipd_client.messages import MessageError, decode

Interval = tuple[float, float]
"""Begin and end, s."""


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

    @classmethod
    def from_map(cls, found: dict[str, Any]) -> Truth:
        """Return the truth of a map that `as_map` made."""
        return cls([(begin_s, end_s) for begin_s, end_s in found["sliding"]], found["utilisation"])


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
