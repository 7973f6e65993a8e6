"""Entries of a run of every kind, how to write them, and a disk that fills up: for the tests of recordings."""

from __future__ import annotations

import resource
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from slipd.events import Bytes, Event, LinkDown, LinkUp, RecordingChanged, Request, Tick
from slipd.recording.entry_walk import Entry
from slipd.recording.mcap_file import EVENTS, RecordingFile, RunHead
from slipd.recording.reader import Recording, open_recording
from slipd_client import messages

CONFIG_TEXT = "# μ stands in the config\n[finger.left]\nmu = 0.5\n"
WALL_NS = 1_700_000_000_000_000_000
ABOUT_RUN = RunHead(CONFIG_TEXT, "b00t", WALL_NS)

TWO_PADS = "".join(
    f"""
[finger.{name}]
mu = 0.5
[finger.{name}.pad]
device = "xela"
port = "ws://127.0.0.1:5000"
sensor = "{sensor}"
rate_hz = 60.0
rows = 4
cols = 4
pitch_m = 0.0047
electrode_m = 0.004
axis_scale = [0.001, 0.001, 0.001]
threshold = 0.05
tare = {[16000.0, 16500.0, 37000.0] * 16}
"""
    for name, sensor in (("left", "1"), ("right", "2"))
)


def _entry(n: int) -> Entry:
    t_ns = 1_000_000_000 + n // 2 * 1_000_000
    if n % 2:
        payload = messages.encode({"seq": n, "t_ns": t_ns, "normal_n": n / 7})
        return Entry(n, t_ns, "slip.left" if n % 4 == 1 else "wrench.left", payload)
    events: list[Event] = [
        Bytes("left.wrench", n.to_bytes(37, "little")),
        LinkUp("left.wrench", "/dev/ttyUSB0"),
        LinkDown("left.wrench", "unplugged"),
        Request(b"\x00client", {"op": "hello", "id": n, "deep": {"a": [1, 2.5, None]}}),
        Tick(n),
        RecordingChanged("slipd-1.mcap", "/state/slipd-1.mcap", "failed", "the disk is full", 3),
    ]
    return Entry(n, t_ns, EVENTS, events[n // 2 % len(events)])


def entries(count: int) -> list[Entry]:
    """Return the first entries of a run: events of every kind, each followed by a message."""
    return [_entry(n) for n in range(count)]


def contents(path: Path) -> tuple[Recording, list[Entry]]:
    recording = open_recording(path)
    return recording, list(recording.entries())


def complete(path: Path) -> list[Entry]:
    """Return the entries of a recording that lacks nothing."""
    recording, found = contents(path)
    assert recording.complete, recording.fault
    return found


def write(path: Path, entries: Iterable[Entry], chunk: int = 1000) -> None:
    """Write entries as a finished recording, in chunks of a given number."""
    file = RecordingFile(path, ABOUT_RUN)
    end = 0
    for item in entries:
        file.add(*item)
        end = item.n + 1
        if end % chunk == 0:
            file.end_chunk()
    file.finish(end)


@contextmanager
def small_disk(size: int) -> Iterator[None]:
    """In the ``with`` block, the kernel limits the files of this process to a size."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
