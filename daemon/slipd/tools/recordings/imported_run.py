"""Write measurements from elsewhere as the recording of a live run: the frame that all importers share."""

from __future__ import annotations

import contextlib
import heapq
from collections.abc import Iterable, Iterator
from pathlib import Path

from slipd.config.model import Config
from slipd.engine.engine import Engine
from slipd.events import Event, LinkSpec, Request, Tick
from slipd.recording.mcap_file import EVENTS, RecordingFile
from slipd.tools.draft import RECORDING, draft

START_NS = 1_000_000_000
"""Time of the first row, ns; the wall-clock time too, because it is not known."""

TICK_NS = 10_000_000
AFTER_NS = 500_000_000
"""Recorded time after the last row, ns: long enough for every stream to become stale."""

BOOT = "imported"


def links_of(settings: Config) -> dict[str, LinkSpec]:
    """Return the links that a run with this config opens, by name."""
    return dict(Engine(settings, boot=BOOT, wall_minus_monotonic_ns=0).links)


def tare_request(finger: str, t_ns: int, length_ns: int) -> tuple[int, Event]:
    """Return the request at ``t_ns`` that tares a finger for ``length_ns``."""
    body = {"v": 1, "id": 1, "op": "tare", "boot": BOOT, "deadline_ns": t_ns + length_ns, "finger": finger}
    return t_ns, Request(b"import", {**body, "stream": "all", "seconds": length_ns * 1e-9})


def write_run(out: Path, config_text: str, events: Iterable[tuple[int, Event]], last_ns: int) -> None:
    """Write the events of the links with the ticks of a run: every 10 ms, until half a second after the last row.

    Args:
        out: Recording to write; an existing one is never overwritten, and a failure leaves no file.
        config_text: Config for the replay, TOML.
        events: ``(t_ns, event)`` in order of time, the first at ``START_NS``.
        last_ns: Time of the last row, ns.

    Raises:
        UsageError: ``out`` exists.
        SlipdError: ``out`` cannot be written.
    """
    ticks: Iterator[tuple[int, Event]] = ((t_ns, Tick()) for t_ns in range(START_NS, last_ns + AFTER_NS + 1, TICK_NS))
    with draft(out, RECORDING) as path:
        file = RecordingFile(path, config_text=config_text, boot=BOOT, wall_minus_monotonic_ns=0)
        with contextlib.closing(file):
            count = 0
            for t_ns, event in heapq.merge(events, ticks, key=lambda timed: timed[0]):
                file.add(count, t_ns, EVENTS, event)
                count += 1
            file.finish(count)
