"""Real-time priority: one force sensor at 1 kHz beside programs that use all processors, with and without the priority.

The writer and the subscriber stand for a sensor and for a robot program with a priority of its own, so they run above
the daemon in every round: what differs is the daemon alone. The three kinds of rounds take turns.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from bench import child, processes, traffic
from bench.tables import Cell, Table
from numpy.typing import NDArray

STREAM, TOPIC = "left.wrench", "wrench.left"

HOGS, QUICK_HOGS = 3, 1
OURS, PEERS = 10, 20
"""Priorities of the daemon, and of the writer and the subscriber."""

HEAD = ("machine, daemon", "p50", "p99", "p99.9", "largest", "readings", "of these without a message")


def run(folder: Path, *, rounds: int, seconds: float, warm_up_s: float, hogs: int = HOGS) -> Table:
    """Measure ``rounds`` rounds of each kind, ``seconds`` each."""
    title = f"Real-time priority: last byte to message beside {hogs} programs that compute, µs"
    kinds = ("nothing beside, without", f"{hogs} hogs, without", f"{hogs} hogs, priority {OURS}")
    if refused := _refused():
        rows: list[list[Cell]] = [[kind, *["not measured"] * (len(HEAD) - 1)] for kind in kinds]
        return Table(title, HEAD, list(rows), [f"The priority is not measured: {refused}."])
    stream = traffic.Stream(
        STREAM,
        traffic.wrench_frames(traffic.steady(round((seconds + warm_up_s) * traffic.WRENCH_HZ)), traffic.PATCH, 0),
        traffic.WRENCH_HZ,
    )
    latencies_us: dict[str, list[NDArray[np.float64]]] = {kind: [] for kind in kinds}
    for _ in range(rounds):
        for number, kind in enumerate(kinds):
            measured = _round(folder, stream, warm_up_s, hogs=hogs if number else 0, priority=OURS * (number == 2))
            latencies_us[kind].append(measured.latency_us[TOPIC])
    rows = [_row(kind, np.concatenate(found)) for kind, found in latencies_us.items()]
    notes = [
        f"{rounds} rounds of {seconds:g} s of each kind, in turns, on {os.cpu_count()} processors. Writer and"
        f" subscriber run under SCHED_FIFO at {PEERS} in every round.",
        "A reading that waits for the processor is judged and published with those behind it, as one message.",
    ]
    return Table(title, HEAD, rows, notes)


def _row(kind: str, found_us: NDArray[np.float64]) -> list[Cell]:
    heard = found_us[~np.isnan(found_us)]
    percentiles = [float(np.percentile(heard, q)) for q in (50, 99, 99.9, 100)]
    return [kind, *percentiles, len(found_us), len(found_us) - len(heard)]


def _round(folder: Path, stream: traffic.Stream, warm_up_s: float, *, hogs: int, priority: int) -> processes.Measured:
    rates = {"slip_hz": 1.0, "wrench_hz": traffic.EVERY_READING_HZ}
    extra = f"\n[realtime]\npriority = {priority}\n"
    with (
        processes.Lines([STREAM]) as lines,
        processes.daemon(folder, lines, rates, extra) as served,
        _hogs(folder, hogs),
    ):
        return processes.measure(
            served,
            lines,
            [stream],
            folder,
            topics={TOPIC: STREAM},
            subscription=TOPIC,
            warm_up_s=warm_up_s,
            priority=PEERS,
        )


@contextlib.contextmanager
def _hogs(folder: Path, count: int) -> Iterator[None]:
    """Run programs that compute without a pause."""
    with contextlib.ExitStack() as stack:
        for _ in range(count):
            hog = child.Child([sys.executable, "-c", "print('on', flush=True)\nwhile True: pass"], folder)
            stack.enter_context(hog).told("on")
        yield


def _refused() -> str:
    """Return why priorities cannot be given here; "" where they can."""
    before = os.sched_getscheduler(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PEERS))
    except PermissionError:
        return "real-time priorities are not permitted to this user"
    os.sched_setscheduler(0, before | os.SCHED_RESET_ON_FORK, os.sched_param(0))
    return ""
