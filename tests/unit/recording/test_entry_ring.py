"""The last entries of a run: what is dropped first, and that a file that begins with them can be replayed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from project import DATA
from recorded_entries import ABOUT_RUN, complete

from slipd import config
from slipd.engine.engine import Engine
from slipd.events import Bytes, LinkUp, Publish, StateRestored
from slipd.recording.entry_walk import Entry
from slipd.recording.incidents import EntryRing
from slipd.recording.mcap_file import EVENTS, RecordingFile, RunHead
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay

MS, SECOND = 1_000_000, 1_000_000_000
UP = LinkUp("left.wrench", "a")


def written(ring: EntryRing, path: Path) -> list:
    """Write a ring, and return its entries."""
    ring.write(RecordingFile(path, ABOUT_RUN, first=ring.first))
    return complete(path)


def test_a_ring_that_dropped_entries_begins_with_the_state_and_the_links_of_then(tmp_path: Path) -> None:
    ring = EntryRing(9 * SECOND)
    ring.add(EVENTS, UP, 0)
    for n in range(100):
        ring.add(EVENTS, Bytes("left.wrench", bytes(20)), n * SECOND)
        ring.add("status", b"\x80", n * SECOND)
        ring.begin_block((StateRestored(f"at {n}"), UP), n * SECOND + MS)
    ring.add(EVENTS, Bytes("left.wrench", b"newest"), 100 * SECOND)
    entries = written(ring, tmp_path / "ring.mcap")
    began_ns = 90 * SECOND + MS
    assert entries[:2] == [
        Entry(ring.first, began_ns, EVENTS, StateRestored("at 90")),
        Entry(ring.first + 1, began_ns, EVENTS, UP),
    ]
    assert [one.t_ns // SECOND for one in entries[2:]] == [n for n in range(91, 100) for _ in range(2)] + [100]
    assert entries[-1].content.data == b"newest"
    assert ring.dropped_early == 0


def test_a_ring_of_a_run_that_has_just_begun_begins_with_it(tmp_path: Path) -> None:
    ring = EntryRing(9 * SECOND)
    ring.add(EVENTS, UP, 5)
    for n in range(3):
        ring.begin_block((StateRestored("at once"), UP), n * 20 * SECOND)
        assert written(ring, tmp_path / f"{n}.mcap") == [Entry(0, 5, EVENTS, UP)], (
            "all of it, however often it is written"
        )


def test_the_zero_of_a_device_that_told_its_name_before_the_ring_begins_is_that_of_the_run(tmp_path: Path) -> None:
    run = open_recording(DATA / "replays" / "bota.mcap")
    clock = {"boot": run.boot, "wall_minus_monotonic_ns": run.wall_minus_monotonic_ns}
    engine = Engine(config.parse(run.config_text, "bota.toml"), **clock)
    ring, heard = EntryRing(SECOND // 2), list[Any]()
    for n, (t_ns, event) in enumerate(run.events()):
        ring.add(EVENTS, event, t_ns)
        heard += [output for output in engine.handle(event, t_ns) if isinstance(output, Publish)]
        if n % 50 == 0:
            ring.begin_block(engine.kept.first_events(t_ns), t_ns)
    ring.write(RecordingFile(tmp_path / "ring.mcap", RunHead(run.config_text, **clock), first=ring.first))
    assert ring.first > 0
    live = [output.body for output in heard if output.topic == "slip.left"][-1]
    again = [body for topic, body in replay(open_recording(tmp_path / "ring.mcap")) if topic == "slip.left"][-1]
    assert (again["tare_id"], again["tare_origin"]) == (live["tare_id"], live["tare_origin"]) == (1, "measured")
    assert again["normal_n"] == pytest.approx(live["normal_n"], abs=0.1)
