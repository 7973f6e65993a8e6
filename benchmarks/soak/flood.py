"""A device that floods: how late does the loop become, and do the other streams still come?"""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from bench.tables import Table
from soak.inside import running, status

SECONDS, QUICK_SECONDS = 60.0, 3.0
SETTLE_S = 2.0
PROBE_S = 0.001
LAG_WANTED_MS = 10.0
RATE_HZ = 1000.0

CASES = {
    "no flood": ("frames", RATE_HZ),
    "10 times its rate": ("frames", 10 * RATE_HZ),
    "frames as fast as the line takes them": ("frames", 0.0),
    "noise as fast as the line takes it": ("noise", 0.0),
}

CONFIG = """
[finger.left]
mu = 0.5
[finger.left.wrench]
device = "bota"
port = "{folder}/flooding"
rate_hz = 1000.0
[finger.right]
mu = 0.5
[finger.right.wrench]
device = "bota"
port = "{folder}/calm"
rate_hz = 800.0
"""


def run(folder: Path, *, quick: bool) -> Table:
    """Measure."""
    seconds = QUICK_SECONDS if quick else SECONDS
    head = ("flood", "lag p50 ms", "p99", "most", "late %", "taken/s", "dropped/s", "other Hz", "CPU %")
    table = Table(f"Floods: {seconds:g} s each", head)
    for case, (kind, rate_hz) in CASES.items():
        table.rows.append((case, *asyncio.run(_case(folder, kind, rate_hz, seconds))))
    table.notes += [
        f"Lag: how late a task of the daemon's loop runs that is due every millisecond; wanted: {LAG_WANTED_MS:g} ms "
        "at most. Late: share of its runs later than that.",
        "Taken: readings of the flooding device that reach the finger; dropped: those beyond the allowed rate.",
        "Other: readings a second of the device beside it, which sends 800.",
    ]
    return table


async def _case(folder: Path, kind: str, rate_hz: float, seconds: float) -> tuple[float, ...]:
    with ExitStack() as stack:
        stack.enter_context(_process("soak.flooder", kind, str(rate_hz), str(folder / "flooding")))
        stack.enter_context(_process("soak.calm_sensor", str(folder / "calm")))
        async with running(folder, CONFIG.format(folder=folder)) as (endpoints, _):
            await asyncio.sleep(SETTLE_S)
            before, begin_s, cpu_s = await status(endpoints), time.monotonic(), time.process_time()
            late_ms = await _lags(seconds)
            took_s, cpu_s = time.monotonic() - begin_s, time.process_time() - cpu_s
            after = await status(endpoints)
    flooding, other = _counts(before, after, "left.wrench"), _counts(before, after, "right.wrench")
    return (
        float(np.percentile(late_ms, 50)),
        float(np.percentile(late_ms, 99)),
        max(late_ms),
        100.0 * float(np.mean(np.array(late_ms) > LAG_WANTED_MS)),
        flooding["samples"] / took_s,
        flooding["dropped"] / took_s,
        other["samples"] / took_s,
        100.0 * cpu_s / took_s,
    )


async def _lags(seconds: float) -> list[float]:
    loop = asyncio.get_running_loop()
    late_ms: list[float] = []
    end_s = loop.time() + seconds
    while (due_s := loop.time() + PROBE_S) < end_s:
        await asyncio.sleep(PROBE_S)
        late_ms.append(1e3 * (loop.time() - due_s))
    return late_ms


def _counts(before: dict[str, Any], after: dict[str, Any], stream: str) -> dict[str, int]:
    first, last = before["streams"][stream], after["streams"][stream]
    return {key: last[key] - first[key] for key in ("samples", "dropped")}


@contextmanager
def _process(module: str, *arguments: str) -> Iterator[None]:
    """A process that ends when its standard input closes."""
    command = [sys.executable, "-m", module, *arguments]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=os.environ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        try:
            yield
        finally:
            process.communicate()
