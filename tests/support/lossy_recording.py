"""A recording that lost its entries of one second, as on a disk that was too slow."""

from __future__ import annotations

from pathlib import Path

from recorded_entries import begun_like

from slipd.recording.mcap_file import EVENTS
from slipd.recording.reader import open_recording

LOST_S = (1.0, 2.0)
"""From the first entry."""


def lossy(path: Path, folder: Path, config_text: str | None = None) -> Path:
    """Write the events of a recording without those of `LOST_S`, with another config where one is given."""
    recording, out = open_recording(path), folder / "lossy.mcap"
    file = begun_like(recording, out, config_text)
    entries = list(recording.entries())
    for entry in entries:
        t_s = (entry.t_ns - entries[0].t_ns) * 1e-9
        if entry.topic == EVENTS and not LOST_S[0] <= t_s < LOST_S[1]:
            file.add(*entry)
    file.finish(len(entries))
    return out
