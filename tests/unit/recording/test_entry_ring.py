"""The last entries of a run: what is dropped first, and that a file that begins with them can be replayed."""

from __future__ import annotations

from pathlib import Path

import pytest
from recorded_entries import ABOUT_RUN, complete

from slipd.events import Bytes, Event, LinkDown, LinkUp, Request, Tick
from slipd.recording import entry_ring
from slipd.recording.entry_ring import Entered, EntryRing, TareEvents
from slipd.recording.mcap_file import RecordingFile

MS, SECOND = 1_000_000, 1_000_000_000
TARE = Request(b"client", {"op": "tare", "finger": "left", "seconds": 0.5})
UP = LinkUp("left.wrench", "a")


@pytest.fixture
def written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Write a ring of small blocks, and return its entries."""

    def write(ring: EntryRing) -> list:
        file = RecordingFile(tmp_path / "ring.mcap", **ABOUT_RUN, first=ring.first)
        ring.write(file)
        return complete(tmp_path / "ring.mcap")

    monkeypatch.setattr(entry_ring, "BLOCK_BYTES", 500)
    return write


def test_a_ring_that_dropped_entries_begins_with_the_links_that_were_open(written) -> None:
    ring = EntryRing(10 * SECOND)
    for event in (UP, LinkUp("left.pad", "b"), LinkUp("right.pad", "c"), LinkDown("left.pad", "unplugged")):
        ring.event(event, 0)
    for n in range(100):
        ring.event(Bytes("left.wrench", bytes(20)), n * SECOND)
    entries = written(ring)
    assert [one.event for one in entries[:2]] == [UP, LinkUp("right.pad", "c")]
    assert entries[0].n == ring.first > 0
    assert isinstance(entries[2], Entered)
    assert 75 * SECOND < entries[2].t_ns <= 89 * SECOND
    assert entries[-1].t_ns == 99 * SECOND


def test_a_ring_that_dropped_a_tare_begins_with_it_so_that_the_zero_is_that_of_the_run(written) -> None:
    ring = EntryRing(SECOND)
    ring.event(UP, 0)
    for n in range(500):
        ring.event(Bytes("left.wrench", bytes(20)), n * 10 * MS)
        if n == 60:
            ring.event(TARE, n * 10 * MS)
    entries = written(ring)
    times_ns = [one.t_ns for one in entries]
    assert (entries[0].t_ns, entries[0].event) == (100 * MS, UP)
    assert (600 * MS, TARE) in [(one.t_ns, one.event) for one in entries]
    assert times_ns == sorted(times_ns)
    assert times_ns[-1] == 4990 * MS


def test_the_readings_before_and_during_a_tare_are_kept() -> None:
    tares = TareEvents()
    for n in range(300):
        event: Event = TARE if n == 100 else Tick(n) if n % 2 else Bytes("left.wrench", b"x")
        tares.update(Entered(n, n * 10 * MS, event))
    kept = tares.before(300)
    assert [one.n for one in kept if one.n < 100] == list(range(48, 100, 2))
    assert (kept[26].event, kept[-1].n) == (TARE, 200)
    assert [one.n for one in tares.before(60)] == list(range(48, 60, 2))
