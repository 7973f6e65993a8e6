"""The truth in the recording of a simulated grasp, beside the events that the engine gets."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from slipd.events import Tick
from slipd.recording.entry_walk import Published
from slipd.recording.mcap_file import RecordingFile
from slipd.recording.reader import open_recording
from slipd.tools.sim.offline_grasp import TRUTH, TruthLog
from slipd_client.messages import decode

BEGIN_NS = 5_000_000_000


def truth_of(path: Path) -> list[dict[str, Any]]:
    entries = open_recording(path).entries()
    return [decode(entry.payload) for entry in entries if isinstance(entry, Published) and entry.topic == TRUTH]


def test_the_truth_stands_between_the_events_in_order_of_time(tmp_path: Path) -> None:
    t_s = np.arange(0.0, 0.05, 0.001)
    trace: Any = SimpleNamespace(t_s=t_s, gross=(t_s > 0.0135) & (t_s < 0.0175), utilisation=np.full(t_s.size, np.nan))
    trace.utilisation[5:] = 0.5
    path = tmp_path / "grasp.mcap"
    file = RecordingFile(path, config_text="", boot="offline", wall_minus_monotonic_ns=0)
    log = TruthLog(file, trace, BEGIN_NS)
    for n, at_ms in enumerate(range(-5, 60, 5)):
        log.event(2 * n, BEGIN_NS + at_ms * 1_000_000, Tick(n))
        log.published(2 * n + 1, BEGIN_NS + at_ms * 1_000_000, "slip.left", b"\x80")
    file.finish(log.entries)
    recording = open_recording(path)
    entries = list(recording.entries())
    assert recording.complete
    assert [entry.n for entry in entries] == list(range(log.entries))
    assert [entry.t_ns for entry in entries] == sorted(entry.t_ns for entry in entries)
    assert [event for _, event in recording.events()] == [Tick(n) for n in range(13)]
    found = truth_of(path)
    assert [(round((one["t_ns"] - BEGIN_NS) * 1e-6), one["sliding"]) for one in found] == [
        (0, False), (10, False), (14, True), (18, False), (28, False), (38, False), (48, False)
    ]  # fmt: skip
    assert [one["utilisation"] for one in found[:2]] == [None, 0.5]
