"""The last entries of a run: what is dropped first, and that a file that begins with them can be replayed."""

from __future__ import annotations

from pathlib import Path

import pytest
from recorded_entries import ABOUT_RUN, complete

from slipd.events import Bytes, Event, LinkDown, LinkUp, Request, StateRestored, Tick
from slipd.recording import entry_ring
from slipd.recording.entry_ring import Entered, EntryRing, TareEvents
from slipd.recording.mcap_file import EVENTS, RecordingFile

MS, SECOND = 1_000_000, 1_000_000_000
TARE = Request(b"client", {"op": "tare", "finger": "left", "seconds": 0.5})
UP = LinkUp("left.wrench", "a")


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(entry_ring, "BLOCK_BYTES", 500)


def written(ring: EntryRing, path: Path) -> list:
    """Write a ring, and return its entries."""
    ring.write(RecordingFile(path, **ABOUT_RUN, first=ring.first))
    return complete(path)


def test_a_ring_that_dropped_entries_begins_with_the_links_that_were_open(tmp_path: Path) -> None:
    ring = EntryRing(9 * SECOND)
    restored = StateRestored("of the run before")
    for event in (restored, UP, LinkUp("left.pad", "b"), LinkUp("right.pad", "c"), LinkDown("left.pad", "unplugged")):
        ring.add(EVENTS, event, 0)
    for n in range(100):
        ring.add(EVENTS, Bytes("left.wrench", bytes(20)), n * SECOND)
    entries = written(ring, tmp_path / "ring.mcap")
    assert [one.event for one in entries[:3]] == [restored, UP, LinkUp("right.pad", "c")]
    assert entries[0].n == ring.first > 0
    assert [one.t_ns // SECOND for one in entries[3:]] == list(range(87, 100))


def test_a_ring_that_dropped_a_tare_begins_with_it_so_that_the_zero_is_that_of_the_run(tmp_path: Path) -> None:
    ring = EntryRing(SECOND)
    ring.add(EVENTS, UP, 0)
    for n in range(500):
        ring.add(EVENTS, Bytes("left.wrench", bytes(20)), n * 10 * MS)
        if n == 60:
            ring.add(EVENTS, TARE, n * 10 * MS)
    entries = written(ring, tmp_path / "ring.mcap")
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
