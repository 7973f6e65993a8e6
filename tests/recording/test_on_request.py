"""A client may ask for a recording, and neither it nor the disk can do harm by that."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from slipd.errors import RecordingError
from slipd.pipeline.events import LinkUp, Record, RecordingFailed, Tick
from slipd.recording import on_request
from slipd.recording.on_request import MOST_UNFINISHED, RequestedRecordings, private_directory, state_dir
from slipd.recording.reader import Entered, Published, open_recording
from slipd.recording.writer import Recorder

DEADLINE_S = 30.0


def make(path: Path, prepare: Callable[[], None]) -> Recorder:
    return Recorder(path, config_text="", boot="b", wall_minus_monotonic_ns=0, prepare=prepare)


@pytest.fixture
def recordings(tmp_path: Path) -> Iterator[RequestedRecordings]:
    made = RequestedRecordings(tmp_path / "state" / "slipd", make)
    yield made
    made.close()


def failure(recordings: RequestedRecordings) -> RecordingFailed:
    end_s = time.monotonic() + DEADLINE_S
    while (failed := recordings.failed()) is None:
        assert time.monotonic() < end_s
        time.sleep(0.002)
    return failed


def test_a_recording_begins_with_the_links_that_are_open(recordings: RequestedRecordings, tmp_path: Path) -> None:
    up = LinkUp("left.wrench", "/dev/ttyUSB0")
    recordings.record_event(Tick(1), 10)
    recordings.record_published("status", b"\x80", 10)
    recordings.take(Record("a.mcap", (up,)), 20)
    recordings.record_event(Tick(2), 30)
    recordings.record_published("status", b"\x80", 30)
    recordings.take(Record(""), 40)
    recordings.record_event(Tick(3), 50)
    recordings.close()
    recording = open_recording(tmp_path / "state" / "slipd" / "a.mcap")
    assert list(recording.entries()) == [
        Entered(0, 20, up),
        Entered(1, 30, Tick(2)),
        Published(2, 30, "status", b"\x80"),
    ]
    assert recording.complete
    assert (recording.path.parent.stat().st_mode & 0o777) == 0o700
    assert recordings.failed() is None


def test_k3_the_next_recording_ends_the_one_that_runs(recordings: RequestedRecordings, tmp_path: Path) -> None:
    recordings.take(Record("a.mcap"), 0)
    recordings.record_event(Tick(1), 1)
    recordings.take(Record("b.mcap"), 2)
    recordings.record_event(Tick(2), 3)
    recordings.close()
    for name, tick in (("a.mcap", Tick(1)), ("b.mcap", Tick(2))):
        recording = open_recording(tmp_path / "state" / "slipd" / name)
        assert [event for _, event in recording.events()] == [tick]
        assert recording.complete


def test_a_file_that_stands_there_is_not_overwritten_and_not_followed(
    recordings: RequestedRecordings, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    private_directory(tmp_path / "state" / "slipd")
    precious = tmp_path / "precious"
    precious.write_text("mine")
    (tmp_path / "state" / "slipd" / "a.mcap").symlink_to(precious)
    recordings.take(Record("a.mcap"), 0)
    failed = failure(recordings)
    assert failed.name == "a.mcap"
    assert "exists already" in failed.reason
    assert recordings.failed() is None, "it is told once"
    recordings.record_event(Tick(1), 1)
    recordings.close()
    assert precious.read_text() == "mine"
    assert [record.message for record in caplog.records] == [failed.reason]


def test_k1_a_disk_that_fails_is_told_and_nothing_else(recordings: RequestedRecordings, tmp_path: Path) -> None:
    private_directory(tmp_path / "state" / "slipd")
    (tmp_path / "state" / "slipd" / "full.mcap").symlink_to("/dev/full")
    recordings.take(Record("full.mcap"), 0)
    for n in range(100):
        recordings.record_event(Tick(n), n)
    assert "No space left on device" in failure(recordings).reason
    recordings.take(Record("next.mcap"), 100)
    recordings.close()
    assert open_recording(tmp_path / "state" / "slipd" / "next.mcap").complete


def test_a_disk_that_fails_at_the_very_end_is_logged(
    recordings: RequestedRecordings, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    private_directory(tmp_path / "state" / "slipd")
    (tmp_path / "state" / "slipd" / "full.mcap").symlink_to("/dev/full")
    recordings.take(Record("full.mcap"), 0)
    recordings.take(Record(""), 1)
    recordings.close()
    assert "No space left on device" in caplog.text


def test_k1_a_slow_disk_is_not_given_more_recordings_than_it_takes(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    go_on = threading.Event()
    made: list[Recorder] = []

    def make_slow(path: Path, prepare: Callable[[], None]) -> Recorder:
        def prepare_late() -> None:
            go_on.wait(DEADLINE_S)
            prepare()

        made.append(make(path, prepare_late))
        return made[-1]

    recordings = RequestedRecordings(tmp_path / "slipd", make_slow)
    refused = []
    for n in range(20):
        recordings.take(Record(f"{n}.mcap", (LinkUp("left", "it"),)), 0)
        recordings.record_event(Tick(n), n)
        failed = recordings.failed()
        refused += [failed.name] if failed is not None and "not taken" in failed.reason else []
        recordings.take(Record(""), 0)
    assert len(made) == MOST_UNFINISHED + 1
    assert refused == [f"{n}.mcap" for n in range(len(made), 20)]
    go_on.set()
    for recorder in made:
        recorder.close()
    recordings.take(Record("next.mcap"), 0)
    assert recordings.failed() is None, "the disk has taken what was before"
    recordings.close()
    assert len(list((tmp_path / "slipd").iterdir())) == len(made)
    assert len(caplog.records) == len(refused)


def test_a_recording_for_which_there_is_no_thread_fails_and_nothing_else(
    recordings: RequestedRecordings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def start(thread: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patch:
        patch.setattr(threading.Thread, "start", start)
        recordings.take(Record("a.mcap"), 0)
    recordings.record_event(Tick(1), 1)
    assert failure(recordings) == RecordingFailed("a.mcap", "can't start new thread")
    recordings.take(Record("b.mcap"), 2)
    recordings.close()
    assert open_recording(tmp_path / "state" / "slipd" / "b.mcap").complete


def test_k1_a_disk_that_hangs_delays_the_end_once_and_not_for_each_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    go_on = threading.Event()
    waits: list[float] = []

    class Hanging(Recorder):
        def close(self, within_s: float = DEADLINE_S) -> None:
            waits.append(within_s)
            super().close(within_s)

    def hang() -> None:
        go_on.wait(DEADLINE_S)

    def make_hanging(path: Path, prepare: Callable[[], None]) -> Recorder:
        return Hanging(path, config_text="", boot="b", wall_minus_monotonic_ns=0, prepare=hang)

    recordings = RequestedRecordings(tmp_path, make_hanging)
    recordings.take(Record("a.mcap"), 0)
    recordings.take(Record("b.mcap"), 0)
    monkeypatch.setattr(on_request, "CLOSE_LIMIT_S", 0.05)
    recordings.close()
    assert (0.0 < waits[0] <= 0.05, waits[1:]) == (True, [0.0]), "the first took all the time there was"
    assert caplog.text.count("has not taken the rest in time") == 2
    go_on.set()


def test_a_directory_that_others_may_write_to_is_none(tmp_path: Path) -> None:
    tmp_path.chmod(0o770)
    with pytest.raises(RecordingError, match="nobody else can write to"):
        private_directory(tmp_path)
    tmp_path.chmod(0o700)
    (tmp_path / "link").symlink_to(tmp_path)
    with pytest.raises(RecordingError, match="nobody else can write to"):
        private_directory(tmp_path / "link")
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="cannot be made"):
        private_directory(tmp_path / "file" / "slipd")


def test_the_directory_is_the_users_own_unless_the_environment_names_another(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("SLIPD_STATE_DIR", "XDG_STATE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", "/home/ann")
    assert state_dir() == Path("/home/ann/.local/state/slipd")
    monkeypatch.setenv("XDG_STATE_HOME", "/state")
    assert state_dir() == Path("/state/slipd")
    monkeypatch.setenv("SLIPD_STATE_DIR", "/mine")
    assert state_dir() == Path("/mine")
