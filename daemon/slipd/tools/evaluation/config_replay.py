"""Replay one recording with one config, and collect what it reported. This module loads the engine."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from slipd import config
from slipd.config import Config
from slipd.errors import RecordingError
from slipd.recording.reader import EventGaps, Recording, open_recording
from slipd.recording.replay import replay
from slipd.tools.evaluation.level_spans import LevelSpan, level_spans
from slipd_client.messages import STATUS_TOPIC, slip_topic

RECORDED = "recorded"
"""What the config of the recording itself is called."""

_SLIP = slip_topic("")


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
    began_s = time.process_time()
    recording = open_recording(path)
    settings = None
    if config_text is not None:
        settings = with_recorded_tares(config.parse(config_text, name), recording)
    begin_s, end_s = outline(recording)
    run = ConfigRun({}, end_s=end_s - begin_s)
    gaps = EventGaps()
    messages = replay(recording, settings=settings, on_event=gaps.add)
    try:
        spans = level_spans(_watched(messages, run, begin_s), end_s, gaps.found)
    except RecordingError as error:
        raise RecordingError(f"{error} ({name})" if config_text is not None else str(error)) from error
    run.spans = {source: [span.shifted(-begin_s) for span in of_source] for source, of_source in spans.items()}
    run.fault = recording.gap
    run.gaps = len(gaps.found)
    run.compute_s = time.process_time() - began_s
    return run


def _watched(
    messages: Iterator[tuple[str, dict[str, Any]]], run: ConfigRun, begin_s: float
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the messages, and note the largest utilisation and the health of the streams."""
    streams: dict[str, StreamHealth] = {}
    for topic, body in messages:
        if topic == STATUS_TOPIC:
            streams = with_status(streams, body)
            run.streams = list(streams.values())
        used = body["utilisation"] if topic.startswith(_SLIP) else None
        if used is not None and (run.largest is None or used > run.largest.utilisation):
            run.largest = Largest(used, body["finger"], body["t_ns"] * 1e-9 - begin_s)
        yield topic, body


def with_recorded_tares(settings: Config, recording: Recording) -> Config:
    """Return a config with the tares of the pads of the recorded one: they were measured, not chosen."""
    recorded = config.parse(recording.config_text, f"{recording.path}: config").finger
    fingers = dict(settings.finger)
    for name, finger in settings.finger.items():
        before = recorded[name].pad if name in recorded else None
        if finger.pad is None or before is None or not before.tare:
            continue
        if (before.rows, before.cols) == (finger.pad.rows, finger.pad.cols):
            pad = finger.pad.model_copy(update={"tare": before.tare})
            fingers[name] = finger.model_copy(update={"pad": pad})
    return settings.model_copy(update={"finger": fingers})


def outline(recording: Recording) -> tuple[float, float]:
    """Return the times of the first and last event on CLOCK_MONOTONIC, s; 0 without any.

    Raises:
        RecordingError: The file cannot be read.
    """
    times_ns: list[int] = []
    for entry in recording.entries():
        times_ns = [times_ns[0] if times_ns else entry.t_ns, entry.t_ns]
    return (times_ns[0] * 1e-9, times_ns[1] * 1e-9) if times_ns else (0.0, 0.0)
