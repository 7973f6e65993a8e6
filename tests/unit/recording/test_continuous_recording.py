"""The whole run in files that follow each other: each opens by itself, nothing is lost in between, the oldest go."""

from __future__ import annotations

import os
from itertools import chain
from pathlib import Path

from client_peers import until
from recorded_entries import ABOUT_RUN, complete

from slipd.config import Continuous
from slipd.events import LinkUp, RecordingChanged, Tick, WallClock
from slipd.recording.mcap_file import EVENTS
from slipd.recording.reader import open_recording
from slipd.recording.recorder import Recorder
from slipd.recording.run_files import RecordingLimitError
from slipd.recording.run_recordings import RETRY_NS, ContinuousRecording

SECOND_NS = 1_000_000_000
OPEN = (LinkUp("left.wrench", "/dev/ttyUSB0"),)


class Run:
    """A continuous recording of ticks."""

    def __init__(self, folder: Path, prepare=lambda: None, **limits: object) -> None:
        self.folder, self.prepare = folder, prepare
        self.recording = ContinuousRecording(
            folder,
            lambda path, t_ns: Recorder(path, ABOUT_RUN, t_ns, prepare=lambda: self.prepare()),
            Continuous(**limits),
            lambda t_ns: f"{WallClock(0).stamp(t_ns)}-b00t",
        )
        self.changes: list = []

    def poll(self, t_ns: int) -> None:
        self.changes += self.recording.follow(t_ns, lambda: OPEN)

    def files(self) -> list[Path]:
        return sorted(self.folder.iterdir())


def test_K3_files_follow_each_other_by_time_without_a_gap_and_open_by_themselves(tmp_path: Path) -> None:
    run = Run(tmp_path, file_s=1.0)
    for n in range(30):
        run.poll(n * SECOND_NS // 10)
        until(lambda: run.recording.running.outcome[0] == "running")
        run.recording.running.add(EVENTS, Tick(n), n * SECOND_NS // 10)
        run.recording.running.add("status", b"\x80", n * SECOND_NS // 10)
    run.recording.close()
    assert [path.name for path in run.files()] == [f"run-1970010{1}T00000{n}Z-b00t-000{n + 1}.mcap" for n in range(3)]
    (up, *first), *others = map(complete, run.files())
    assert {one.content for one in (up, *(entries.pop(0) for entries in others))} == set(OPEN)
    ticks = [one.content.suspended_ns for one in (*first, *chain(*others)) if one.topic == EVENTS]
    assert ticks == list(range(30))


def test_a_file_that_is_large_enough_is_followed_by_the_next(tmp_path: Path) -> None:
    run = Run(tmp_path, file_bytes=1_000_000)
    run.poll(0)
    for _ in range(120):
        run.recording.running.add("tactile.left", os.urandom(10_000), 1)
    until(lambda: run.files() and run.files()[0].stat().st_size >= 1_000_000)
    until(lambda: run.poll(2) or run.recording._count == 2)
    run.recording.close()
    assert len(run.files()) == 2
    assert all(open_recording(path).closed for path in run.files())


def test_the_state_is_reported_as_that_of_the_whole_run_and_a_failure_is_retried(tmp_path: Path) -> None:
    def full() -> None:
        raise RecordingLimitError("the disk is full")

    run = Run(tmp_path, prepare=full)
    run.poll(0)
    until(lambda: run.poll(1) or run.changes)
    (path,) = {change.path for change in run.changes}
    assert run.changes == [RecordingChanged("", path, "limited", f"{path}: the disk is full")]
    run.prepare = lambda: None
    run.poll(RETRY_NS // 2)
    assert run.files() == []
    run.poll(RETRY_NS + 1)
    until(lambda: run.poll(RETRY_NS + 2) or len(run.changes) > 1)
    assert (run.changes[-1].name, run.changes[-1].state) == ("", "running")
    run.recording.close()
    assert open_recording(run.files()[0]).closed
