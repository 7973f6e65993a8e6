"""Replay one recording with one config: the levels that it gives over time.

What reads recordings and the engine are loaded by a replay alone: where all results are kept, nothing needs them.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from slipd.errors import RecordingError
from slipd_client.messages import GRASP_TOPIC, STATUS_TOPIC, slip_topic

if TYPE_CHECKING:
    from slipd.config import Config
    from slipd.recording.reader import EventGaps, Gap


NOT_RECORDED = "not_recorded"
"""Reason of "unknown" from the begin of a gap to the first message after it."""

_SLIP = slip_topic("")

T = TypeVar("T")


class LevelSpan(NamedTuple):
    """A time in which one source reported one level for the same reasons.

    Attributes:
        level: The level.
        reasons: Its reasons, the most important first.
        evidence: Kinds of evidence of motion that any message of this time names, in order of appearance.
        begin_s: Time of the first such reading, s.
        end_s: Time of the first reading after it, s, or the end of the run.
    """

    level: str
    reasons: tuple[str, ...]
    evidence: tuple[str, ...]
    begin_s: float
    end_s: float

    @property
    def seconds(self) -> float:
        """Its length, s."""
        return self.end_s - self.begin_s


def joined(parts: Iterable[tuple[float, float, T]]) -> list[tuple[float, float, T]]:
    """Return begin, end and value of each part; parts of equal value that follow each other are one."""
    found: list[tuple[float, float, T]] = []
    for begin_s, end_s, value in parts:
        if found and found[-1][1:] == (begin_s, value):
            begin_s = found.pop()[0]
        found.append((begin_s, end_s, value))
    return found


def level_spans(messages: Iterable[tuple[str, dict[str, Any]]], events: EventGaps) -> dict[str, list[LevelSpan]]:
    """Return what each source reported: every finger by its name, and "grasp" where both are judged together.

    Args:
        messages: Topic and body of every message of a run, in order. Only ``slip`` and ``grasp`` matter; both are
            published at once where the level changes, and where only the reasons do, at their rate.
        events: The gaps between the events, each added before the messages that it caused; times count from its begin,
            and the run lasts to the last event or message.

    Returns:
        The spans of each source in order, each from the end of the one before. Before its first message a source has
        none; in a gap it is "unknown".
    """
    found: dict[str, list[LevelSpan]] = {}
    last_s, seen = 0.0, 0
    for topic, body in messages:
        seen = _interrupt(found, events.found, seen)
        t_s = events.time_s(body["t_ns"])
        last_s = max(last_s, t_s)
        if topic == GRASP_TOPIC or topic.startswith(_SLIP):
            words = body["level"], tuple(body["reasons"]), tuple(body.get("evidence") or ())
            _append(found.setdefault(topic.removeprefix(_SLIP), []), *words, t_s)
    _interrupt(found, events.found, seen)
    last_s = max(last_s, events.newest_s or 0.0)
    return {source: [*spans[:-1], spans[-1]._replace(end_s=last_s)] for source, spans in found.items()}


def _interrupt(found: dict[str, list[LevelSpan]], gaps: Sequence[Gap], seen: int) -> int:
    """End every level at each gap after the first ``seen``; return the number of gaps."""
    for gap in gaps[seen:]:
        for spans in found.values():
            _append(spans, "unknown", (NOT_RECORDED,), (), gap.begin_s)
    return len(gaps)


def _append(
    spans: list[LevelSpan], level: str, reasons: tuple[str, ...], evidence: tuple[str, ...], t_s: float
) -> None:
    if spans:
        last = spans[-1]
        t_s = max(t_s, last.begin_s)  # a verdict on a stream that became stale has the time of its last reading
        spans[-1] = last._replace(end_s=t_s)
        if (last.level, last.reasons) == (level, reasons):
            named = tuple(dict.fromkeys(last.evidence + evidence))
            spans[-1] = last._replace(evidence=named, end_s=t_s)
            return
    spans.append(LevelSpan(level, reasons, evidence, t_s, t_s))


RECORDED = "recorded"
"""What the config of the recording itself is called."""


@dataclass(frozen=True, slots=True)
class Largest:
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

    @classmethod
    def from_map(cls, found: dict[str, Any]) -> ConfigRun:
        """Return the run of a map that `dataclasses.asdict` made, and that JSON may have stored.

        Raises:
            KeyError, TypeError, ValueError, AttributeError: It is no such map.
        """
        known = {
            "spans": {
                source: [
                    LevelSpan(level, tuple(reasons), tuple(evidence), begin_s, end_s)
                    for level, reasons, evidence, begin_s, end_s in spans
                ]
                for source, spans in found["spans"].items()
            },
            "largest": None if found["largest"] is None else Largest(**found["largest"]),
            "streams": [StreamHealth(*stream) for stream in found["streams"]],
        }
        return cls(**(found | known))


def run_config(path: Path, config_text: str | None, name: str) -> ConfigRun:
    """Replay a recording with a config.

    The zero of a pad belongs to the run that was recorded: where the recorded config has a ``tare`` for the pad, it
    stays.

    Args:
        path: The recording.
        config_text: The config, TOML; None: the recorded one.
        name: Its name, for errors.

    Raises:
        ConfigError: The config has faults.
        RecordingError: The file cannot be read, or an event does not fit the config.
    """
    from slipd import config
    from slipd.recording.reader import EventGaps, open_recording
    from slipd.recording.replay import replay

    began_s = time.process_time()
    recording = open_recording(path)
    settings = None
    if config_text is not None:
        settings = with_recorded_tares(config.parse(config_text, name), recording.settings())
    first_ns, _ = next(recording.events(), (0, None))
    events = EventGaps(first_ns)
    run = ConfigRun({})
    messages = replay(recording, settings=settings, on_event=events.add)
    try:
        run.spans = level_spans(_watched(messages, run, events), events)
    except RecordingError as error:
        raise RecordingError(f"{error} ({name})" if config_text is not None else str(error)) from error
    run.end_s = events.newest_s or 0.0
    run.fault = recording.missing
    run.gaps = len(events.found)
    run.compute_s = time.process_time() - began_s
    return run


def _watched(
    messages: Iterator[tuple[str, dict[str, Any]]], run: ConfigRun, events: EventGaps
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the messages, and note the largest utilisation and the health of the streams."""
    streams: dict[str, StreamHealth] = {}
    for topic, body in messages:
        if topic == STATUS_TOPIC:
            streams = with_status(streams, body)
            run.streams = list(streams.values())
        used = body["utilisation"] if topic.startswith(_SLIP) else None
        if used is not None and (run.largest is None or used > run.largest.utilisation):
            run.largest = Largest(used, body["finger"], events.time_s(body["t_ns"]))
        yield topic, body


def with_recorded_tares(settings: Config, recorded: Config) -> Config:
    """Return a config with the tares of the pads of the recorded one: they were measured, not chosen."""
    fingers = dict(settings.finger)
    for name, finger in settings.finger.items():
        before = recorded.finger[name].pad if name in recorded.finger else None
        if finger.pad is None or before is None or not before.tare:
            continue
        if (before.rows, before.cols) == (finger.pad.rows, finger.pad.cols):
            pad = finger.pad.model_copy(update={"tare": before.tare})
            fingers[name] = finger.model_copy(update={"pad": pad})
    return settings.model_copy(update={"finger": fingers})
