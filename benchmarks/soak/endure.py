"""The virtual gripper for half an hour with seeded faults: does the daemon grow, lose messages, or run late?

Robot programs grip the box of the demo, again and again, while the lines fail. Gripper, daemon, subscriber and an
idle loop run at the same time; all but the subscriber and the robot program are processes of their own.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections import Counter
from pathlib import Path

import numpy as np
from bench.child import BenchError, Child
from bench.tables import Table
from project import CONFIG, MODULES
from soak.watched_loop import Watched

from slipd.tools.sim.robot_program import RobotProgram
from slipd_client.subscriber import Subscriber

QUICK_SECONDS = 40.0
FIRST_SEED = 1
WARM_UP_SHARE = 0.2
WINDOW_SHARE = 0.1
"""The end, and as much behind the warm-up, are compared."""

MOST_DRIFT_KB = 1024
STORY_S = 60.0
"""A robot program that ends earlier, because of a fault or at its end, is followed by another."""

LAST_S = 120.0
"""Before the end no story begins: each program may still wait for its streams and finish."""


class _Ear:
    """A healthy subscriber of everything."""

    def __init__(self, endpoint: str) -> None:
        self.messages = self.missed = 0
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._listen, args=(endpoint,))
        self._thread.start()

    def _listen(self, endpoint: str) -> None:
        with Subscriber(endpoint, ("",), silence_s=None) as subscriber:
            while not self._stopped.is_set():
                if (message := subscriber.receive(0.1)) is not None:
                    self.messages += 1
                    self.missed += message.missed

    def stop(self) -> None:
        self._stopped.set()
        self._thread.join()


def run(folder: Path, seconds: float, *, quick: bool) -> list[Table]:
    """Measure.

    Raises:
        BenchError: A process failed.
    """
    seconds = QUICK_SECONDS if quick else seconds
    folder = folder / "endure"
    folder.mkdir()
    config = folder / "demo.toml"
    text = (CONFIG / "demo.toml").read_text(encoding="utf-8")
    config.write_text(text.replace('"virtual/', f'"{folder}/'), encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": MODULES}
    command = [sys.executable, "-m", "soak.watched_loop", str(folder), str(seconds)]
    with Child([*command, str(config)], folder, env=environment) as daemon:
        publish, requests = daemon.told("publish:"), daemon.told("requests:")
        with Child(command, folder, env=environment) as idle:
            ear = _Ear(publish)
            try:
                stories = _stories(folder, publish, requests, seconds - LAST_S if not quick else 1.0)
                watched = Watched(**json.loads(daemon.told("watched")))
            finally:
                ear.stop()
            alone = Watched(**json.loads(idle.told("watched")))
    return [_lags(watched, alone, stories, seconds), _growth(watched, ear, seconds)]


def _stories(folder: Path, publish: str, requests: str, seconds: float) -> Counter[str]:
    """Play stories for a time; return how many there were, of grippers and programs, and the faults by kind."""
    told: Counter[str] = Counter()
    end_s = time.monotonic() + seconds
    environment = os.environ | {"PYTHONPATH": MODULES}
    while time.monotonic() < end_s:
        command = [sys.executable, "-m", "soak.faulty_gripper", str(folder), str(FIRST_SEED + told["stories"])]
        with Child(command, folder, env=environment) as gripper:
            gripper.told("ready")
            story_end_s = time.monotonic() + STORY_S
            while (left_s := story_end_s - time.monotonic()) > 0.0:
                program = RobotProgram(publish, requests)
                program.start()
                program.join(left_s)
                program.end()
                program.join()
                told["programs"] += 1
                told["ended early"] += bool(program.report.error)
            gripper.terminate()
            told.update(json.loads(gripper.told("faults")))
        told["stories"] += 1
    return told


def _lags(watched: Watched, alone: Watched, stories: Counter[str], seconds: float) -> Table:
    table = Table(f"Virtual gripper with faults, {seconds:.0f} s: lag in ms", ("loop", "p50", "p99", "p99.9", "most"))
    table.rows += [("the daemon's", *watched.lag_ms), ("an idle one", *alone.lag_ms)]
    counts = ", ".join(f"{kind} {count}" for kind, count in sorted(stories.items()) if kind not in _TOLD)
    table.notes += [
        "Lag: how late a task runs that is due every 5 ms; the idle loop runs at the same time in another process.",
        f"{stories['stories']} virtual grippers one after another, seeds from {FIRST_SEED} on. Robot programs: "
        f"{stories['programs']}, of which {stories['ended early']} were refused or ended by a fault. Faults: {counts}.",
    ]
    return table


_TOLD = ("stories", "programs", "ended early")


def _growth(watched: Watched, ear: _Ear, seconds: float) -> Table:
    head = ("what", "behind the warm-up", "at the end", "most", "wanted", "reached")
    table = Table(f"Virtual gripper with faults, {seconds:.0f} s: what grows", head)
    rows = np.array(watched.holdings)
    part = max(1, round(WINDOW_SHARE * len(rows)))
    begin = round(WARM_UP_SHARE * len(rows))
    if len(rows) < begin + part:
        raise BenchError("the daemon ran too short to be watched")
    early, late = rows[begin : begin + part].max(axis=0), rows[-part:].max(axis=0)
    wanted = (MOST_DRIFT_KB, 0, 0)
    for name, before, after, most, drift in zip(
        ("memory, kB", "open files", "tasks"), early, late, rows.max(axis=0), wanted, strict=True
    ):
        limit = f"at most {drift} more" if drift else "no more"
        reached = "yes" if after - before <= drift else "no"
        table.rows.append((name, int(before), int(after), int(most), limit, reached))
    table.notes += [
        f"A healthy subscriber of everything received {ear.messages} messages; missing by their numbers: {ear.missed};"
        f" wanted: 0; reached: {'no' if ear.missed else 'yes'}.",
        f"Most within {100 * WINDOW_SHARE:g} % of the time, after the first {100 * WARM_UP_SHARE:g} % and at the end;"
        " sampled every 10 s.",
    ]
    return table
