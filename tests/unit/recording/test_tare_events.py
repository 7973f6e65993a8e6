"""A file that begins during a run begins with the tares, so that its zero is that of the run."""

from __future__ import annotations

from pathlib import Path

import pytest

from slipd.events import Bytes, Event, LinkUp, Request, Tick
from slipd.recording import entry_ring
from slipd.recording.entry_ring import Entered, EntryRing, TareEvents
from slipd.recording.mcap_file import RecordingFile
from slipd.recording.reader import open_recording

MS = 1_000_000
TARE = Request(b"client", {"op": "tare", "finger": "left", "seconds": 0.5})


def test_the_readings_before_and_during_a_tare_are_kept() -> None:
    tares = TareEvents()
    for n in range(300):
        event: Event = TARE if n == 100 else Tick(n) if n % 2 else Bytes("left.wrench", b"x")
        tares.update(Entered(n, n * 10 * MS, event))
    kept = tares.before(300)
    assert [one.n for one in kept if one.n < 100] == list(range(48, 100, 2))
    assert kept[26].event == TARE
    assert kept[-1].n == 200
    assert [one.n for one in tares.before(60)] == list(range(48, 60, 2))


def test_a_ring_that_dropped_a_tare_begins_with_it(tmp_path: Path, about_run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(entry_ring, "BLOCK_BYTES", 500)
    ring = EntryRing(10**9)
    ring.event(LinkUp("left.wrench", "a"), 0)
    for n in range(500):
        ring.event(Bytes("left.wrench", bytes(20)), n * 10 * MS)
        if n == 60:
            ring.event(TARE, n * 10 * MS)
    file = RecordingFile(tmp_path / "ring.mcap", **about_run, first=ring.first)
    ring.write(file)
    recording = open_recording(tmp_path / "ring.mcap")
    events = list(recording.events())
    assert recording.complete
    assert events[0] == (100 * MS, LinkUp("left.wrench", "a"))
    assert (600 * MS, TARE) in events
    assert [t_ns for t_ns, _ in events] == sorted(t_ns for t_ns, _ in events)
    assert events[-1][0] == 4990 * MS
