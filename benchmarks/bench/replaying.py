"""Replay: how much faster than real time a recording of two full fingers runs through the engine.

The recording is made by the engine itself from the bytes of the emulated devices, each at its exact time, so that it is
the same on every machine. A replay reads it from the disk as ``slipd replay`` does, on one core.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from bench import traffic
from bench.tables import Table

from slipd import config
from slipd.engine.engine import Engine
from slipd.events import Bytes, Event, LinkUp, Publish, Request, Tick
from slipd.recording.mcap_file import EVENTS, RecordingFile, RunHead
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd_client.messages import encode

BOOT = "0123456789abcdef"
BEGIN_NS = 1_000_000_000
TICK_HZ = 200
TARE_AT_NS = 200_000_000
"""Time at which the free fingers are tared, from the start of the recording, ns."""
REPEATS, QUICK_REPEATS = 5, 1
WANTED = 10.0


def run(folder: Path, *, seconds: float, quick: bool) -> Table:
    """Record ``seconds``, and replay them."""
    path = folder / "replayed.mcap"
    entries = record(path, seconds)
    rows, same = [], True
    for _ in range(QUICK_REPEATS if quick else REPEATS):
        cpu_s, wall_s, messages = _replay(path)
        rows.append((seconds / cpu_s, seconds / wall_s))
        same = same and messages == [(topic, payload) for topic, payload in open_recording(path).messages()]
    table = Table(
        f"Replay: two fingers, {traffic.WRENCH_HZ} readings/s and {traffic.PAD_HZ} images/s each, {seconds:g} s",
        ("repeat", "real time, of CPU time", "real time, of the clock"),
    )
    table.rows += [(str(number + 1), *row) for number, row in enumerate(rows)]
    median = np.median(rows, axis=0).tolist()
    table.rows.append(("median", *median))
    table.notes += [
        f"Times real time on one core, with {entries} entries read from the disk and every message packed.",
        f"The messages are {'' if same else 'NOT '}byte for byte those of the recording.",
        f"Wanted: at least {WANTED:g} times real time; reached: {'yes' if median[0] >= WANTED else 'no'}.",
    ]
    return table


def record(path: Path, seconds: float) -> int:
    """Write a recording of two fingers that grip and hold; return the number of its entries."""
    streams = traffic.two_fingers(seconds)
    text = config_text(streams)
    engine = Engine(config.parse(text, "bench"), boot=BOOT, wall_minus_monotonic_ns=0)
    file = RecordingFile(path, RunHead(text, BOOT, 0))
    n = 0
    for t_ns, event in _events(streams, seconds):
        file.add(n, t_ns, EVENTS, event)
        n += 1
        for output in engine.handle(event, t_ns):
            if isinstance(output, Publish):
                file.add(n, t_ns, output.topic, encode(output.body))
                n += 1
    file.finish(n)
    return n


def config_text(streams: list[traffic.Stream]) -> str:
    """The config of the recorded rig, with the default rates."""
    return traffic.config_text({stream.name: f"/dev/{stream.name}" for stream in streams}, {})


def _events(streams: list[traffic.Stream], seconds: float) -> list[tuple[int, Event]]:
    found: list[tuple[int, Event]] = [(BEGIN_NS, LinkUp(stream.name, stream.name)) for stream in streams]
    timed: list[tuple[int, Event]] = [
        (BEGIN_NS + round(1e9 * k / TICK_HZ), Tick()) for k in range(round(seconds * TICK_HZ))
    ]
    for finger in sorted({stream.name.partition(".")[0] for stream in streams}):
        t_ns = BEGIN_NS + TARE_AT_NS
        tare = {"v": 1, "id": 1, "op": "tare", "boot": BOOT, "deadline_ns": t_ns + TARE_AT_NS, "finger": finger}
        timed.append((t_ns, Request(finger.encode(), tare | {"seconds": traffic.TARE_S})))
    for stream in streams:
        for k, frame in enumerate(stream.frames):
            t_ns = BEGIN_NS + round(1e9 * (stream.phase_s + (k + 1) / stream.rate_hz))
            timed.append((t_ns, Bytes(stream.name, frame)))
    return found + sorted(timed, key=lambda item: item[0])


def _replay(path: Path) -> tuple[float, float, list[tuple[str, bytes]]]:
    """CPU time and time of the clock that a replay took, s, and its messages."""
    recording = open_recording(path)
    begin_s, cpu_s = time.perf_counter(), time.process_time()
    messages = [(topic, encode(body)) for topic, body in replay(recording)]
    return time.process_time() - cpu_s, time.perf_counter() - begin_s, messages
