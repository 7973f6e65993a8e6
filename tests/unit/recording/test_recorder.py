import os
import re
import subprocess
import sys
from pathlib import Path
from random import Random
from threading import Event as Signal

import msgpack
import pytest
from client_peers import PATIENCE_S, until
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC
from recorded_entries import ABOUT_RUN, WALL_NS, complete, contents, entries, small_disk

from slipd.errors import RecordingError
from slipd.events import Bytes, Tick
from slipd.recording import recorder as recorder_module
from slipd.recording.entry_walk import Entry
from slipd.recording.mcap_file import EVENTS
from slipd.recording.mcap_records import ENTRY_LIMIT_BYTES
from slipd.recording.recorder import Recorder
from slipd.recording.run_files import DiskLimits

WRITE_UNTIL_KILLED = """
import sys, time
from pathlib import Path
from slipd.events import Bytes
from slipd.recording.mcap_file import EVENTS, RunHead
from slipd.recording.recorder import Recorder
recorder = Recorder(Path(sys.argv[1]), RunHead("", "b", 0))
def put(n):
    recorder.add(EVENTS, Bytes("left", n.to_bytes(40, "big")), 1_000_000 * n)
for n in range(1000):
    put(n)
sys.stdin.readline()  # the thousand must reach the file without anyone closing it
n = 1000
while True:
    put(n)
    n += 1
    if n % 20 == 0:
        time.sleep(0.002)
"""


def readable(path: Path) -> int:
    """Return how many entries can be read now."""
    try:
        return len(contents(path)[1])
    except RecordingError:
        return 0


def record(recorder: Recorder, entries) -> None:
    for _, t_ns, topic, content in entries:
        recorder.add(topic, content, t_ns)


def test_other_tools_find_msgpack_with_wall_clock_times_and_a_schema_on_every_channel(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run.mcap", ABOUT_RUN)
    record(recorder, entries(40))
    recorder.close()
    recorder.close()
    with pytest.raises(ValueError, match="is closed"):
        recorder.add(EVENTS, Tick(), 1)
    with (tmp_path / "run.mcap").open("rb") as file:
        found = [
            (message.sequence, message.log_time, msgpack.unpackb(message.data)["t_ns"], channel, schema)
            for schema, channel, message in make_reader(file).iter_messages(log_time_order=False)
        ]
    assert [each[:3] for each in found] == [(one.n, one.t_ns + WALL_NS, one.t_ns) for one in entries(40)]
    assert {(channel.topic, channel.message_encoding, schema is None) for *_, channel, schema in found} == {
        (topic, "msgpack", False) for topic in ("slipd/event", "slip.left", "wrench.left")
    }


def test_K2_a_killed_writer_leaves_a_readable_file(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    process = subprocess.Popen([sys.executable, "-c", WRITE_UNTIL_KILLED, path], stdin=subprocess.PIPE)
    try:
        until(lambda: readable(path) == 1000)
        size = path.stat().st_size
        process.stdin.write(b"\n")
        process.stdin.flush()
        until(lambda: path.stat().st_size > 2 * size)
    finally:
        process.kill()
        process.communicate()
    recording, found = contents(path)
    assert len(found) > 1000
    assert found == [Entry(n, 1_000_000 * n, EVENTS, Bytes("left", n.to_bytes(40, "big"))) for n in range(len(found))]
    assert (recording.complete, recording.lost, recording.fault is None) == (False, 0, False)


@pytest.mark.parametrize("size", [0, 1, 100])
def test_a_disk_that_fails_at_the_start_is_reported_at_once_and_keeps_no_file(tmp_path: Path, size: int) -> None:
    with small_disk(size), pytest.raises(RecordingError, match=r"run\.mcap: cannot be written: File too large"):
        Recorder(tmp_path / "run.mcap", ABOUT_RUN)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(RecordingError, match="/dev/full: cannot be written: No space left on device"):
        Recorder(Path("/dev/full"), ABOUT_RUN)
    assert Path("/dev/full").is_char_device()


def test_a_disk_that_fails_after_the_last_entry_loses_none(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run.mcap", ABOUT_RUN)
    with small_disk(1), pytest.raises(RecordingError, match=r"the recording stopped: File too large$"):
        recorder.close()


@pytest.mark.parametrize("size", [5000, 100_000, 299_999])
def test_K1_a_disk_that_fills_up_stops_the_recording_and_leaves_a_readable_beginning(tmp_path: Path, size: int) -> None:
    path, random = tmp_path / "run.mcap", Random(1)
    recorder = Recorder(path, ABOUT_RUN)
    with small_disk(size):
        for n in range(3000):
            recorder.add(EVENTS, Bytes("left", random.randbytes(100)), n)
        with pytest.raises(RecordingError, match="the recording stopped: File too large"):
            recorder.close()
    assert path.stat().st_size <= size
    with path.open("rb") as file:
        assert make_reader(file).get_summary() is None, "it has the footer that other readers want"
    recording, found = contents(path)
    assert [entry.t_ns for entry in found] == list(range(3000 - recorder.lost))
    assert (recording.closed, recording.lost) == (True, recorder.lost), "its end says what is missing"
    assert f"(File too large); {recorder.lost} entries are missing" in str(recording.fault)


@pytest.mark.parametrize(
    ("limits", "limit"),
    [
        (DiskLimits(max_bytes=4000, min_free_bytes=0), "the recording reached recording.max_bytes, 4000"),
        (
            DiskLimits(max_bytes=10**9, min_free_bytes=2**62),
            "free bytes, less than recording.min_free_bytes, 46116860184",
        ),
    ],
    ids=["size", "disk"],
)
def test_a_limit_ends_a_recording_in_good_order_and_costs_the_live_path_nothing(
    tmp_path: Path, limits: DiskLimits, limit: str
) -> None:
    queued = Signal()
    recorder = Recorder(tmp_path / "run.mcap", ABOUT_RUN, limits=limits, prepare=lambda: queued.wait())
    record(recorder, entries(2000))
    queued.set()
    until(lambda: recorder.outcome[0] == "limited")
    record(recorder, entries(100))
    recorder.close()
    assert re.search(rf"^{tmp_path}/run.mcap: .*{limit}", recorder.outcome[1])
    found = complete(tmp_path / "run.mcap")
    assert (recorder.outcome[0], recorder.lost) == ("limited", 0)
    assert found == entries(2000)[: len(found)] != []


def test_what_reached_the_file_before_the_disk_failed_is_not_called_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = Recorder(tmp_path / "run.mcap", ABOUT_RUN)
    record(recorder, entries(100))
    until(lambda: readable(tmp_path / "run.mcap") == 100)
    monkeypatch.setattr(os, "fdatasync", lambda _: os.fsync(1 << 20))
    record(recorder, entries(105)[100:])
    with pytest.raises(RecordingError, match="Bad file descriptor"):
        recorder.close()
    assert recorder.lost <= 5


def test_K1_a_disk_that_stalls_costs_entries_which_are_counted_and_leave_a_gap(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stalled, go_on = Signal(), Signal()

    def fdatasync(fd: int) -> None:
        stalled.set()
        go_on.wait(PATIENCE_S)

    monkeypatch.setattr(os, "fdatasync", fdatasync)
    monkeypatch.setattr(recorder_module, "QUEUE_LIMIT", 10)
    recorder = Recorder(tmp_path / "run.mcap", ABOUT_RUN)
    assert stalled.wait(PATIENCE_S)
    record(recorder, entries(40))
    assert recorder.lost == 30
    go_on.set()
    until(lambda: recorder._queue.empty())
    record(recorder, entries(41)[40:])
    recorder.close()
    assert recorder.outcome == ("running", "")
    recording, found = contents(tmp_path / "run.mcap")
    assert found == entries(10) + entries(41)[40:]
    assert (recording.lost, recording.fault, recording.complete) == (30, None, False)


def test_an_entry_that_cannot_be_written_stops_the_recording_not_the_run(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run.mcap", ABOUT_RUN)
    recorder.add("slip.left", bytes(ENTRY_LIMIT_BYTES + 1), 0)
    recorder.add(EVENTS, Tick(), 1)
    with pytest.raises(RecordingError, match="must have at most"):
        recorder.close()
    assert recorder.lost == 2
    assert recorder.path.read_bytes().count(MCAP0_MAGIC) == 2, "a beginning and one end"


def test_K3_a_file_that_exists_or_cannot_be_created_is_reported_at_once(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_text("precious")
    for name, why in (
        ("run.mcap", "exists already"),
        ("nowhere/run.mcap", "cannot be created: there is no folder"),
        (300 * "x", "cannot be created: File name too long"),
    ):
        with pytest.raises(RecordingError, match=f"{name}: {why}"):
            Recorder(tmp_path / name, ABOUT_RUN)
    assert (tmp_path / "run.mcap").read_text() == "precious"


def test_K3_a_file_that_is_deleted_while_it_is_written_is_reported(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run.mcap", ABOUT_RUN)
    recorder.add("status", b"\x80", 1)
    (tmp_path / "run.mcap").unlink()
    until(lambda: recorder.outcome[0] == "failed")
    assert recorder.outcome[1].endswith("run.mcap: the recording stopped: the file was deleted while it was written")
    recorder.end()
