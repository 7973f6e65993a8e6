import os
import re
import subprocess
import sys
from pathlib import Path
from threading import Event as Signal

import msgpack
import pytest
from mcap.reader import make_reader
from recorded_entries import PATIENCE_S, complete, contents, wait_until

from slipd.errors import RecordingError
from slipd.events import Bytes, Tick
from slipd.recording import writer
from slipd.recording.entry_walk import Entered
from slipd.recording.mcap_file import ENTRY_LIMIT_BYTES
from slipd.recording.writer import Recorder, Room

WRITE_UNTIL_KILLED = """
import sys, time
from pathlib import Path
from slipd.events import Bytes
from slipd.recording.writer import Recorder
recorder = Recorder(Path(sys.argv[1]), config_text="", boot="b", wall_minus_monotonic_ns=0)
def put(n):
    recorder.event(Bytes("left", n.to_bytes(40, "big")), 1_000_000 * n)
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

WRITE_INTO_A_SMALL_DISK = """
import os, resource, sys, time
from pathlib import Path
from slipd.errors import RecordingError
from slipd.events import Bytes
from slipd.recording.writer import Recorder
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
recorder = Recorder(Path(sys.argv[1]), config_text="", boot="b", wall_minus_monotonic_ns=0)
for n in range(3000):
    recorder.event(Bytes("left", os.urandom(100)), n)
try:
    recorder.close()
except RecordingError as error:
    print(recorder.lost, error)
"""


def readable(path: Path) -> int:
    """Return how many entries can be read now."""
    try:
        return len(contents(path)[1])
    except RecordingError:
        return 0


def record(recorder: Recorder, entries) -> None:
    for item in entries:
        if isinstance(item, Entered):
            recorder.event(item.event, item.t_ns)
        else:
            recorder.published(item.topic, item.payload, item.t_ns)


def test_other_tools_find_msgpack_with_wall_clock_times_and_a_schema_on_every_channel(
    tmp_path: Path, about_run, entries
) -> None:
    recorder = Recorder(tmp_path / "run.mcap", **about_run)
    record(recorder, entries(40))
    recorder.close()
    with (tmp_path / "run.mcap").open("rb") as file:
        found = list(make_reader(file).iter_messages(log_time_order=False))
    assert [message.sequence for _, _, message in found] == list(range(40))
    for (schema, channel, message), item in zip(found, entries(40), strict=True):
        assert schema is not None
        assert channel.message_encoding == "msgpack"
        wall_ns = msgpack.unpackb(message.data)["t_ns"] + about_run["wall_minus_monotonic_ns"]
        assert wall_ns == message.log_time == item.t_ns + about_run["wall_minus_monotonic_ns"]
    assert {channel.topic for _, channel, _ in found} == {"slipd/event", "slip.left", "wrench.left"}


def test_K2_a_killed_writer_leaves_a_readable_file(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    process = subprocess.Popen([sys.executable, "-c", WRITE_UNTIL_KILLED, path], stdin=subprocess.PIPE)
    assert process.stdin is not None
    try:
        wait_until(lambda: readable(path) == 1000)
        size = path.stat().st_size
        process.stdin.write(b"\n")
        process.stdin.flush()
        wait_until(lambda: path.stat().st_size > 2 * size)
    finally:
        process.kill()
        process.communicate()
    recording, found = contents(path)
    assert len(found) > 1000
    assert found == [Entered(n, 1_000_000 * n, Bytes("left", n.to_bytes(40, "big"))) for n in range(len(found))]
    assert (recording.complete, recording.lost) == (False, 0)
    assert recording.fault is not None


@pytest.mark.parametrize("size", [0, 1, 100])
def test_a_disk_that_fails_at_the_start_is_reported_at_once_and_keeps_no_file(
    tmp_path: Path, about_run, small_disk, size: int
) -> None:
    with small_disk(size), pytest.raises(RecordingError, match=r"run\.mcap: cannot be written: File too large"):
        Recorder(tmp_path / "run.mcap", **about_run)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(RecordingError, match="/dev/full: cannot be written: No space left on device"):
        Recorder(Path("/dev/full"), **about_run)
    assert Path("/dev/full").is_char_device()


@pytest.mark.parametrize("size", [5000, 100_000, 299_999])
def test_K1_a_disk_that_fills_up_stops_the_recording_and_leaves_a_readable_beginning(tmp_path: Path, size: int) -> None:
    path = tmp_path / "run.mcap"
    command = [sys.executable, "-c", WRITE_INTO_A_SMALL_DISK, path, str(size)]
    told = subprocess.run(command, capture_output=True, text=True, check=True)
    lost, text = told.stdout.split(maxsplit=1)
    assert "the recording stopped: File too large" in text
    assert path.stat().st_size <= size
    recording, found = contents(path)
    assert [entry.t_ns for entry in found] == list(range(3000 - int(lost)))
    assert (recording.closed, recording.lost) == (True, int(lost)), "its end says what is missing"
    assert f"(File too large); {lost} entries are missing" in str(recording.fault)


@pytest.mark.parametrize(
    ("room", "limit"),
    [
        (Room(max_bytes=4000, min_free_bytes=0), "the recording reached recording.max_bytes, 4000"),
        (Room(max_bytes=10**9, min_free_bytes=2**62), "free bytes, less than recording.min_free_bytes, 46116860184"),
    ],
    ids=["size", "disk"],
)
def test_a_limit_ends_a_recording_in_good_order_and_costs_the_live_path_nothing(
    tmp_path: Path, about_run, entries, room: Room, limit: str
) -> None:
    queued = Signal()
    recorder = Recorder(tmp_path / "run.mcap", **about_run, room=room, prepare=lambda: queued.wait())
    record(recorder, entries(2000))
    queued.set()
    wait_until(lambda: recorder.limit)
    record(recorder, entries(100))
    recorder.close()
    assert re.search(rf"^{tmp_path}/run.mcap: .*{limit}", str(recorder.limit))
    assert (recorder.failure, recorder.lost) == (None, 0)
    found = complete(tmp_path / "run.mcap")
    assert found == entries(2000)[: len(found)] != []


def test_what_reached_the_file_before_the_disk_failed_is_not_called_lost(
    tmp_path: Path, about_run, entries, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fdatasync(fd: int) -> None:
        raise OSError(5, "Input/output error")

    recorder = Recorder(tmp_path / "run.mcap", **about_run)
    record(recorder, entries(100))
    wait_until(lambda: readable(tmp_path / "run.mcap") == 100)
    monkeypatch.setattr(os, "fdatasync", fdatasync)
    record(recorder, entries(105)[100:])
    with pytest.raises(RecordingError, match="Input/output error"):
        recorder.close()
    assert recorder.lost <= 5


def test_K1_a_disk_that_stalls_costs_entries_which_are_counted_and_leave_a_gap(
    tmp_path: Path, about_run, entries, monkeypatch: pytest.MonkeyPatch
) -> None:
    stalled, go_on = Signal(), Signal()

    def fdatasync(fd: int) -> None:
        stalled.set()
        go_on.wait(PATIENCE_S)

    monkeypatch.setattr(os, "fdatasync", fdatasync)
    monkeypatch.setattr(writer, "QUEUE_LIMIT", 10)
    recorder = Recorder(tmp_path / "run.mcap", **about_run)
    assert stalled.wait(PATIENCE_S)
    record(recorder, entries(40))
    assert recorder.lost == 30
    go_on.set()
    wait_until(lambda: recorder._queue.empty())
    record(recorder, entries(41)[40:])
    recorder.close()
    assert recorder.failure is None
    recording, found = contents(tmp_path / "run.mcap")
    assert found == entries(10) + entries(41)[40:]
    assert (recording.lost, recording.fault, recording.complete) == (30, None, False)


def test_an_entry_that_cannot_be_written_stops_the_recording_not_the_run(tmp_path: Path, about_run) -> None:
    recorder = Recorder(tmp_path / "run.mcap", **about_run)
    recorder.published("slip.left", bytes(ENTRY_LIMIT_BYTES + 1), 0)
    recorder.event(Tick(), 1)
    with pytest.raises(RecordingError, match="must have at most"):
        recorder.close()
    assert recorder.lost == 2


def test_K3_a_file_that_exists_or_cannot_be_created_is_reported_at_once(tmp_path: Path, about_run) -> None:
    (tmp_path / "run.mcap").write_text("precious")
    for name, why in (("run.mcap", "exists already"), ("nowhere/run.mcap", "cannot be created: there is no folder")):
        with pytest.raises(RecordingError, match=f"{name}: {why}"):
            Recorder(tmp_path / name, **about_run)
    assert (tmp_path / "run.mcap").read_text() == "precious"


def test_a_closed_recorder_refuses_entries(tmp_path: Path, about_run) -> None:
    recorder = Recorder(tmp_path / "run.mcap", **about_run)
    recorder.close()
    recorder.close()
    with pytest.raises(ValueError, match="is closed"):
        recorder.event(Tick(), 1)
    assert complete(tmp_path / "run.mcap") == []
