"""Recordings that are written anew: without a second of their entries, or with the messages that a run would write."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from slipd import config
from slipd.engine.engine import Engine
from slipd.events import Publish
from slipd.recording.mcap_file import EVENTS, RecordingFile, RunHead
from slipd.recording.reader import Recording, open_recording
from slipd_client.messages import encode

LOST_S = (1.0, 2.0)
"""From the first entry."""


def begun_like(recording: Recording, path: Path) -> RecordingFile:
    """Begin a file of the same run."""
    return RecordingFile(path, RunHead(recording.config_text, recording.boot, recording.wall_minus_monotonic_ns))


def lossy(path: Path, folder: Path) -> Path:
    """Write the events of a recording without those of `LOST_S`, as on a disk that was too slow."""
    recording, out = open_recording(path), folder / "lossy.mcap"
    file = begun_like(recording, out)
    entries = list(recording.entries())
    for entry in entries:
        t_s = (entry.t_ns - entries[0].t_ns) * 1e-9
        if entry.topic == EVENTS and not LOST_S[0] <= t_s < LOST_S[1]:
            file.add(*entry)
    file.finish(len(entries))
    return out


def live(path: Path, out: Path, change: Callable[[str, dict[str, Any]], object] = lambda topic, body: None) -> Path:
    """Write the events of a recording and what an engine publishes for them; ``change`` may edit each message."""
    recording = open_recording(path)
    settings = config.parse(recording.config_text, str(path))
    engine = Engine(settings, boot=recording.boot, wall_minus_monotonic_ns=recording.wall_minus_monotonic_ns)
    file = begun_like(recording, out)
    n = 0
    for t_ns, event in recording.events():
        file.add(n, t_ns, EVENTS, event)
        n += 1
        for output in engine.handle(event, t_ns):
            if isinstance(output, Publish):
                body = dict(output.body)
                change(output.topic, body)
                file.add(n, t_ns, output.topic, encode(body))
                n += 1
    file.finish(n)
    return out
