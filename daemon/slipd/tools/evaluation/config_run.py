"""What one recording gave with one config. This module does not load the engine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

from slipd.tools.evaluation.level_spans import LevelSpan

RECORDED = "recorded"
"""What the config of the recording itself is called."""


class Largest(NamedTuple):
    """Largest utilisation that any finger reported, 1 slips, with the finger and its time, s."""

    utilisation: float
    finger: str
    t_s: float


class StreamHealth(NamedTuple):
    """One stream over a run, as of its last `status` message.

    Attributes:
        stream: Its name, for example ``left.wrench``.
        health: The worst health since the first reading, because every stream begins as STALE; the last one where no
            reading came. 0 OK, 1 WARN, 2 ERROR, 3 STALE.
        samples: Readings.
        bad: Damaged frames.
        lost: Readings that are missing by the device's own numbering.
        dropped: Readings that were dropped because the device sent too many.
        reconnects: Times that the link came up again.
    """

    stream: str
    health: int
    samples: int
    bad: int
    lost: int
    dropped: int
    reconnects: int


def with_status(found: Mapping[str, StreamHealth], body: Mapping[str, Any]) -> dict[str, StreamHealth]:
    """Return the health of every stream after another `status` message, by name."""
    return {
        name: StreamHealth(
            name,
            max(stream["health"], found[name].health if name in found and found[name].samples else 0),
            *(stream[count] or 0 for count in StreamHealth._fields[2:]),
        )
        for name, stream in body["streams"].items()
    }


@dataclass(slots=True)
class ConfigRun:
    """What one recording gave with one config. Times are seconds since the first event of the recording.

    Attributes:
        spans: Levels of each finger, and of the "grasp" where there is one.
        largest: Largest utilisation; None where none was known.
        end_s: Time of the last event.
        fault: Why events are missing, for people; "" where none are.
        streams: Health of every stream, of recordings that are long enough for a `status` message.
        gaps: Times without events: entries are missing, or the daemon stood still.
        compute_s: Processor time of the replay.
    """

    spans: dict[str, list[LevelSpan]]
    largest: Largest | None = None
    end_s: float = 0.0
    fault: str = ""
    streams: list[StreamHealth] = field(default_factory=list)
    gaps: int = 0
    compute_s: float = field(default=0.0, compare=False)

    def as_map(self) -> dict[str, Any]:
        """Return all of it as maps and lists."""
        return asdict(self)

    @classmethod
    def from_map(cls, found: dict[str, Any]) -> ConfigRun:
        """Return the run of a map that `as_map` made, and that JSON may have stored.

        Raises:
            KeyError, TypeError, ValueError, AttributeError: It is no such map.
        """
        known = {
            "spans": {source: [_span(*span) for span in spans] for source, spans in found["spans"].items()},
            "largest": None if found["largest"] is None else Largest(*found["largest"]),
            "streams": [StreamHealth(*stream) for stream in found["streams"]],
        }
        return cls(**(found | known))


def _span(level: str, reasons: list[str], evidence: list[str], begin_s: float, end_s: float) -> LevelSpan:
    return LevelSpan(level, tuple(reasons), tuple(evidence), begin_s, end_s)
