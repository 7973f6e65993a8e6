"""What one recording gave with one config: levels over time, health, and the truth beside them. Loads no engine."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from slipd.tools.evaluation.level_spans import LevelSpan
from slipd.tools.evaluation.streams_of_run import StreamHealth

RECORDED = "recorded"
"""What the config of the recording itself is called."""

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


@dataclass(frozen=True, slots=True)
class Largest:
    """Largest utilisation that any finger reported, 1 slips, with the finger and its time, s."""

    utilisation: float
    finger: str
    t_s: float


@dataclass(slots=True)
class ConfigRun:
    """What one recording gave with one config. Times are seconds since the first event of the recording.

    Attributes:
        spans: Levels of each finger, and of the "grasp" where there is one.
        largest: Largest utilisation; None where none was known.
        end_s: Time of the last event.
        fault: Why events are missing, for people; "" where none are.
        truth: What truly happened; None where the recording does not say so.
        streams: Health of every stream, of recordings that are long enough for a `status` message.
        gaps: Times without events: entries are missing, or the daemon stood still.
        compute_s: Processor time of the replay.
    """

    spans: dict[str, list[LevelSpan]]
    largest: Largest | None = None
    end_s: float = 0.0
    fault: str = ""
    truth: Truth | None = None
    streams: list[StreamHealth] = field(default_factory=list)
    gaps: int = 0
    compute_s: float = field(default=0.0, compare=False)

    def as_map(self) -> dict[str, Any]:
        """Return all of it as maps and lists."""
        return asdict(self)

    @classmethod
    def from_map(cls, found: dict[str, Any]) -> ConfigRun:
        """Return the run of a map that `as_map` made.

        Raises:
            KeyError, TypeError, ValueError, AttributeError: It is no such map.
        """
        spans = {
            source: [
                LevelSpan(**span | {key: tuple(span[key]) for key in ("reasons", "evidence")}) for span in of_source
            ]
            for source, of_source in found["spans"].items()
        }
        largest = None if found["largest"] is None else Largest(**found["largest"])
        truth = None if found["truth"] is None else Truth.from_map(found["truth"])
        streams = [StreamHealth(**stream) for stream in found["streams"]]
        rest = (found[key] for key in ("gaps", "compute_s"))
        return cls(spans, largest, found["end_s"], found["fault"], truth, streams, *rest)
