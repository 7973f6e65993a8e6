"""Replay one recording with one config, and collect what it reported. This module loads the engine."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from slipd import config
from slipd.config import Config
from slipd.errors import RecordingError
from slipd.recording.reader import EventGaps, Recording, open_recording
from slipd.recording.replay import replay
from slipd.tools.evaluation.config_run import ConfigRun, Largest, StreamHealth, level_spans, with_status
from slipd_client.messages import STATUS_TOPIC, slip_topic

_SLIP = slip_topic("")


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
    first_ns, _ = next(recording.events(), (0, None))
    events = EventGaps(first_ns)
    run = ConfigRun({})
    messages = replay(recording, settings=settings, on_event=events.add)
    try:
        run.spans = level_spans(_watched(messages, run, events), events)
    except RecordingError as error:
        raise RecordingError(f"{error} ({name})" if config_text is not None else str(error)) from error
    run.end_s = events.newest_s or 0.0
    run.fault = recording.gap
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
