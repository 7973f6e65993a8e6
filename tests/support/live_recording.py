"""A recording of the kind that a run writes: events, and the messages that they caused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from recorded_entries import begun_like

from slipd import config
from slipd.engine.engine import Engine
from slipd.events import Publish
from slipd.recording.mcap_file import EVENTS
from slipd.recording.reader import open_recording
from slipd_client.messages import encode


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
