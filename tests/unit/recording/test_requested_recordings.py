"""A client can request a recording; neither the client nor the disk can harm the run."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from client_peers import PATIENCE_S, until
from recorded_entries import complete, small_disk

from slipd.errors import RecordingError
from slipd.events import LinkUp, Record, RecordingChanged, Tick
from slipd.recording import recorder, run_recordings
from slipd.recording.entry_walk import Entry
from slipd.recording.mcap_file import EVENTS, RunHead
from slipd.recording.recorder import START_LIMIT_NS, Recorder
from slipd.recording.run_files import DiskLimits, check_folder, private_directory, state_dir
from slipd.recording.run_recordings import MOST_UNFINISHED, RequestedRecordings

LIMITS = DiskLimits(max_bytes=10**9, min_free_bytes=0)


def make(path: Path, t_ns: int, prepare: Callable[[], None], limits: DiskLimits = LIMITS) -> Recorder:
    return Recorder(path, RunHead("", "b", 0), t_ns, prepare=prepare, limits=limits)


def held(disk: threading.Event, state: Path) -> Callable[[], None]:
    """Return a preparation of a folder that waits for the disk."""

    def prepare() -> None:
        disk.wait(PATIENCE_S)
        private_directory(state)

    return prepare


@pytest.fixture
def state(tmp_path: Path) -> Path:
    return tmp_path / "state" / "slipd"


@pytest.fixture
def recordings(state: Path) -> Iterator[RequestedRecordings]:
    made = RequestedRecordings(state, partial(make, prepare=lambda: private_directory(state)))
    yield made
    made.close()


def add(recordings: RequestedRecordings, *entry: Any) -> None:
    if recordings.running is not None:
        recordings.running.add(*entry)


def news(recordings: RequestedRecordings, t_ns: int = 1) -> RecordingChanged:
    """Wait for the next change."""
    found: list[RecordingChanged] = []
    until(lambda: found.extend(recordings.changes(t_ns)) or found)
    (change,) = found
    return change


def test_K3_a_recording_begins_with_the_links_that_are_open_and_the_next_one_ends_it(
    recordings: RequestedRecordings, state: Path
) -> None:
    up = LinkUp("left.wrench", "/dev/ttyUSB0")
    for n, record in enumerate((None, Record("a.mcap", (up,)), Record("b.mcap"), Record(""))):
        if record is not None:
            recordings.handle(record, 20 * n)
        add(recordings, EVENTS, Tick(n), 20 * n + 10)
        add(recordings, "status", b"\x80", 20 * n + 10)
    recordings.close()
    first, second = state / "a.mcap", state / "b.mcap"
    assert complete(first) == [
        Entry(0, 20, EVENTS, up),
        Entry(1, 30, EVENTS, Tick(1)),
        Entry(2, 30, "status", b"\x80"),
    ]
    assert complete(second) == [Entry(0, 50, EVENTS, Tick(2)), Entry(1, 50, "status", b"\x80")]
    assert (state.stat().st_mode & 0o777) == 0o700
    assert recordings.changes(80) == [RecordingChanged(path.name, str(path), "running") for path in (first, second)]
    assert recordings.changes(90) == []


def test_K1_a_disk_that_fails_is_reported_and_nothing_else(recordings: RequestedRecordings, state: Path) -> None:
    recordings.handle(Record("full.mcap"), 0)
    assert news(recordings).state == "running"
    recorder = recordings.running
    size = recorder.path.stat().st_size
    reason = f"{recorder.path}: the recording stopped: File too large"
    with small_disk(size + 10):
        for n in range(100):
            add(recordings, EVENTS, Tick(n), n)
        until(lambda: recorder.lost >= 100)  # the thread counts on after the failure
        assert recorder.path.stat().st_size == size, "no part of an end"
        assert news(recordings, 2) == RecordingChanged("full.mcap", str(recorder.path), "failed", reason, 100)
        add(recordings, EVENTS, Tick(101), 101)
    recordings.handle(Record("next.mcap"), 200)
    assert news(recordings).state == "running"
    with small_disk((state / "next.mcap").stat().st_size):
        recordings.handle(Record(""), 201)
        assert "File too large" in news(recordings, 202).reason, "at the end too"
    assert recordings.changes(203) == []


@pytest.mark.parametrize(
    ("prepare", "state", "reason"),
    [
        (lambda _: private_directory(Path("/proc/slipd")), "failed", "/proc/slipd: cannot be created: No such file"),
        (lambda folder: check_folder(folder / "none", LIMITS, 3), "failed", "cannot be read: No such file"),
        (lambda folder: (folder / "slipd-3.mcap").symlink_to("of-mine.mcap"), "failed", "slipd-3.mcap: exists already"),
        (
            lambda folder: check_folder(folder, LIMITS, 2),
            "limited",
            "holds 2 recordings, and recording.max_files is 2: move",
        ),
        (
            lambda folder: check_folder(folder, DiskLimits(max_bytes=1, min_free_bytes=2**62), 3),
            "limited",
            "free bytes, less than recording.min_free_bytes",
        ),
    ],
    ids=["no folder", "unreadable", "a link to a file", "too many", "no room"],
)
def test_a_folder_that_cannot_be_used_or_is_full_or_has_the_file_keeps_a_recording_from_beginning(
    tmp_path: Path, prepare: Callable[[Path], None], state: str, reason: str, caplog: pytest.LogCaptureFixture
) -> None:
    precious = dict.fromkeys(("slipd-1.mcap", "slipd-2.mcap", "of-mine.mcap", "slipd.txt"), "mine")
    for name, text in precious.items():
        (tmp_path / name).write_text(text)
    check_folder(tmp_path, LIMITS, 3)
    made = RequestedRecordings(tmp_path, partial(make, prepare=lambda: prepare(tmp_path)))
    made.handle(Record("slipd-3.mcap"), 0)
    refused = news(made)
    assert made.changes(2) == [], "it is reported once"
    add(made, EVENTS, Tick(1), 1)
    made.close()
    assert refused == RecordingChanged("slipd-3.mcap", str(tmp_path / "slipd-3.mcap"), state, refused.reason)
    assert reason in refused.reason
    assert caplog.messages == [refused.reason]
    assert {path.name: path.read_text() for path in tmp_path.iterdir() if not path.is_symlink()} == precious


def test_a_file_that_the_disk_does_not_create_in_time_is_given_up_and_removed(state: Path) -> None:
    disk = threading.Event()
    made = RequestedRecordings(state, partial(make, prepare=held(disk, state)))
    made.handle(Record("a.mcap"), 0)
    assert made.changes(START_LIMIT_NS - 1) == []
    path = str(state / "a.mcap")
    reason = f"{path}: the disk did not create the file within 0.5 s"
    assert made.changes(START_LIMIT_NS) == [RecordingChanged("a.mcap", path, "failed", reason)]
    disk.set()
    made.close()
    assert made.changes(2 * START_LIMIT_NS) == []
    assert list(state.iterdir()) == []


def test_lost_entries_are_reported_periodically(
    recordings: RequestedRecordings, state: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    recordings.handle(Record("a.mcap"), 0)
    assert news(recordings, 1).lost == 0
    monkeypatch.setattr(recorder, "QUEUE_LIMIT", 0)
    for n in range(7):
        add(recordings, EVENTS, Tick(n), n)
    assert recordings.changes(2) == []
    assert recordings.changes(2_000_000_000) == [RecordingChanged("a.mcap", str(state / "a.mcap"), "running", "", 7)]
    assert "7 entries lost so far: the disk is too slow" in caplog.text
    add(recordings, EVENTS, Tick(8), 8)
    assert recordings.changes(2_100_000_000) == []
    recordings.close()
    assert "8 entries are missing: the disk was too slow" in caplog.text


def test_K1_a_slow_disk_gets_no_more_recordings_than_it_can_write(
    state: Path, caplog: pytest.LogCaptureFixture
) -> None:
    disk = threading.Event()
    recordings = RequestedRecordings(state, partial(make, prepare=held(disk, state)))
    refused = []
    for n in range(20):
        recordings.handle(Record(f"{n}.mcap", (LinkUp("left", "it"),)), 0)
        add(recordings, EVENTS, Tick(n), n)
        refused += [change.name for change in recordings.changes(0) if "still writing" in change.reason]
        recordings.handle(Record(""), 0)
    made = list(recordings._ended)
    assert len(made) == MOST_UNFINISHED + 1
    assert refused == [f"{n}.mcap" for n in range(len(made), 20)]
    disk.set()
    for each in made:
        each.close()
    recordings.handle(Record("next.mcap"), 0)
    states = {change.state for change in recordings.changes(1)}, recordings._ended
    assert states == ({"running"}, []), "the disk has taken what was before, and nothing of it is kept"
    recordings.close()
    assert sorted(path.name for path in state.iterdir()) == ["0.mcap", "1.mcap", "2.mcap", "next.mcap"]
    assert [record.levelname for record in caplog.records].count("WARNING") == len(refused)


def test_K1_a_disk_that_hangs_delays_the_end_once_not_once_per_recording(
    state: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    disk = threading.Event()
    waits: list[float] = []
    real = Recorder.close

    def close(recorder: Recorder, within_s: float) -> None:
        waits.append(within_s)
        real(recorder, within_s)

    monkeypatch.setattr(Recorder, "close", close)
    recordings = RequestedRecordings(state, partial(make, prepare=held(disk, state)))
    for name in ("a.mcap", "b.mcap"):
        recordings.handle(Record(name), 0)
    monkeypatch.setattr(run_recordings, "CLOSE_LIMIT_S", 0.05)
    recordings.close()
    assert waits[0] <= 0.05
    assert waits[1:] == [0.0], "the first took all the time there was"
    assert caplog.text.count("did not write the last entries in time") == 2
    disk.set()


@pytest.mark.parametrize(
    ("make_it", "error"),
    [
        (lambda path: path.mkdir(mode=0o770) or path.chmod(0o770), "to which nobody else can write"),
        (lambda path: path.symlink_to(path.parent), "to which nobody else can write"),
        (lambda path: path.write_text(""), "cannot be created"),
    ],
    ids=["of a group", "a link", "a file"],
)
def test_a_directory_that_others_could_change_is_refused(
    tmp_path: Path, make_it: Callable[[Path], object], error: str
) -> None:
    make_it(tmp_path / "slipd")
    with pytest.raises(RecordingError, match=error):
        private_directory(tmp_path / "slipd")


def test_the_directory_belongs_to_the_user_unless_the_environment_names_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("SLIPD_STATE_DIR", "XDG_STATE_HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value, folder in (
        ("HOME", "/home/ann", "/home/ann/.local/state/slipd"),
        ("XDG_STATE_HOME", "/state", "/state/slipd"),
        ("SLIPD_STATE_DIR", "/mine", "/mine"),
    ):
        monkeypatch.setenv(name, value)
        assert state_dir() == Path(folder)
