"""Plays a run and watches it: what it holds over time, what a subscriber receives, what its recordings hold."""

from __future__ import annotations

import asyncio
import gc
import json
import logging
import os
import sys
import time
import tracemalloc
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from bench.child import Child
from project import MODULES, ROOT
from shifts.shift_holdings import ShiftHoldings, open_names
from shifts.shift_run import LogCounter, ShiftRun

from slipd.compile_kernels import compile_kernels
from slipd.recording.reader import open_recording

SAMPLES, LEAST_BETWEEN_S = 60, 5.0
WARM_UP_SHARE, WINDOW_SHARE = 0.2, 0.1
"""The end, and as much behind the warm-up, are compared."""

RECORDING_FAULTS = ("recording-failed", "incident-failed")
KEPT_REQUESTED = 3
MOST_WAITS = 200
FILE_S, TRACED_FILE_S = 600.0, 30.0
"""Of the continuous recording; a short one keeps the index of the file in progress small in the short run."""


@dataclass
class Found:
    """What a run showed.

    Attributes:
        hours: Simulated.
        off_hours: Of them with devices that were switched off.
        took_s: Time that it took.
        cpu_s: Processor time of the daemon's process.
        samples: What was held over time.
        heard: Messages that the subscriber received, and those that it missed.
        published: Messages of the daemon.
        events: Events that entered it.
        faults: Number of faults of the lines by kind.
        jobs: Number of jobs by what they were.
        refusals: Refused requests by op and code.
        requests: Number of requests, without renewals.
        not_ready: Times that the streams did not work again.
        slips: Number of times that the box slid.
        breaks: Number of breaks with devices on and off.
        log: Lines of the log, from warnings on.
        wrong: What did not hold.
        files: Kept recordings by kind, and how many of them are complete without a gap.
        lost: Entries that a recording or the memory of incidents lost.
        incidents: Incidents saved and not saved.
        run_files: Files of the continuous recording so far.
        traced: Growth by place, bytes and blocks; empty without a trace.
    """

    hours: float
    took_s: float = 0.0
    cpu_s: float = 0.0
    samples: list[ShiftHoldings] = field(default_factory=list)
    heard: tuple[int, int] = (0, 0)
    published: int = 0
    events: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    jobs: Counter[str] = field(default_factory=Counter)
    refusals: Counter[str] = field(default_factory=Counter)
    off_hours: float = 0.0
    requests: int = 0
    not_ready: int = 0
    slips: int = 0
    breaks: Counter[str] = field(default_factory=Counter)
    log: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    files: dict[str, tuple[int, int]] = field(default_factory=dict)
    lost: int = 0
    incidents: tuple[int, int] = (0, 0)
    run_files: int = 0
    traced: list[tuple[str, int, int]] = field(default_factory=list)

    @property
    def sound(self) -> bool:
        """Nothing was lost, and everything held; what grew is in the report."""
        whole = all(count == complete for count, complete in self.files.values())
        faults = sum(self.log[name] for name in RECORDING_FAULTS)
        return whole and not (self.wrong or self.lost or self.heard[1] or self.not_ready or self.incidents[1] or faults)


def watch(folder: Path, seed: int, hours: float, most_s: float, *, trace: bool = False) -> Found:
    """Play a run in this process, with a subscriber in another.

    Args:
        folder: For recordings and sockets.
        seed: Of everything.
        hours: Simulated time.
        most_s: Longest real time; the run ends earlier then.
        trace: Trace allocations behind the warm-up.
    """
    log, counter = logging.getLogger("slipd"), LogCounter()
    log.addHandler(counter)
    log.propagate = False
    try:
        return asyncio.run(_watch(folder / f"recordings-{seed}", seed, hours, most_s, counter, trace=trace))
    finally:
        log.removeHandler(counter)
        log.propagate = True


async def _watch(folder: Path, seed: int, hours: float, most_s: float, log: LogCounter, *, trace: bool) -> Found:
    compile_kernels()
    found, samples = Found(hours), folder.with_suffix(".jsonl")
    run = ShiftRun(folder, seed, TRACED_FILE_S if trace else FILE_S)
    with run.service:
        run.service.open()
        run.service.ready = True
        began_s, began_cpu_s = time.monotonic(), time.process_time()
        command = [sys.executable, "-m", "shifts.shift_subscriber", run.service.endpoints.publish]
        with Child(command, folder.parent, env=os.environ | {"PYTHONPATH": MODULES}) as subscriber:
            before: tracemalloc.Snapshot | None = None

            async def sample() -> None:
                nonlocal before
                await _until_saved()
                held = ShiftHoldings.now(run.hours, run.engine)
                with samples.open("a") as file:
                    file.write(json.dumps(held.as_dict()) + "\n")
                _make_room(folder)
                spent_s = time.monotonic() - began_s
                print(f"{run.hours:8.3f} h in {spent_s:6.0f} s, {held.memory_kb} kB", file=sys.stderr, flush=True)
                if trace and before is None and run.hours >= WARM_UP_SHARE * hours:
                    before = _traced()

            while not run.service._publisher.subscriptions:  # noqa: ASYNC110 - another process
                await asyncio.sleep(0.01)
            await run.play(hours, max(3600 * hours / SAMPLES, LEAST_BETWEEN_S), sample, most_s)
            await sample()
            if before is not None:
                found.traced = _growth(before)
            found.cpu_s, found.took_s = time.process_time() - began_cpu_s, time.monotonic() - began_s
            while any(peer.waiting for peer in run.service._publisher._listener.peers):  # noqa: ASYNC110
                await asyncio.sleep(0.01)
            found.published = sum(run.messages.values())
            subscriber.terminate()
            heard = await asyncio.to_thread(subscriber.told, "heard")
            found.heard = tuple(json.loads(heard))
    found.samples = [ShiftHoldings(**json.loads(line)) for line in samples.read_text().splitlines()]
    _note(found, run, log, folder)
    return found


async def _until_saved() -> None:
    """Wait until no incident is being saved, which takes memory for a while."""
    for _ in range(MOST_WAITS):
        if not any(name.endswith(".mcap") and "incident-" in name for name in open_names()):
            return
        await asyncio.sleep(0.05)


def _make_room(folder: Path) -> None:
    """Delete all but the newest requested recordings, as people do."""
    for file in sorted(folder.glob("slipd-*.mcap"))[:-KEPT_REQUESTED]:
        file.unlink()


def _note(found: Found, run: ShiftRun, log: LogCounter, folder: Path) -> None:
    program = run.program
    found.off_hours = run.lines.off_ns / 3.6e12
    found.hours, found.breaks = run.hours, program.breaks
    found.events, found.faults, found.slips = run.events, run.lines.faults, run.slips
    found.jobs, found.refusals, found.requests = program.jobs, program.refusals, program.requests
    found.not_ready, found.log, found.wrong = program.not_ready, log.counts, run.wrong
    incidents, continuous = run.service._incidents, run.service._continuous
    assert incidents is not None
    assert continuous is not None
    found.lost = incidents._lost + incidents._ring.dropped_early + run.lost_entries
    found.incidents, found.run_files = (incidents._outcome.saved, incidents._outcome.failed), continuous._count
    for kind in ("run", "incident", "slipd"):
        files = sorted(folder.glob(f"{kind}-*.mcap"))
        found.files[kind] = (len(files), sum(_is_whole(file) for file in files))


def _is_whole(file: Path) -> bool:
    recording = open_recording(file)
    for _ in recording.entries():
        pass
    return recording.complete


def _traced() -> tracemalloc.Snapshot:
    gc.collect()
    tracemalloc.start()
    return tracemalloc.take_snapshot()


def _growth(before: tracemalloc.Snapshot) -> list[tuple[str, int, int]]:
    gc.collect()
    after = tracemalloc.take_snapshot()
    tracemalloc.stop()
    own = [tracemalloc.Filter(inclusive=False, filename_pattern=pattern) for pattern in ("*/shifts/*", "*tracemalloc*")]
    changes = after.filter_traces(own).compare_to(before.filter_traces(own), "lineno")
    return [(str(change.traceback).removeprefix(f"{ROOT}/"), change.size_diff, change.count_diff) for change in changes]
