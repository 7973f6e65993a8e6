"""A device that is unplugged and plugged in again, a thousand times: idle, within a frame, with commands unread."""

from __future__ import annotations

import asyncio
import os
import random
import time
import tty
from pathlib import Path

import numpy as np
from bench.tables import Table
from soak.inside import Holdings, Told, running

from slipd.devices import bota

CYCLES, QUICK_CYCLES = 1000, 30
WARM_UP_SHARE = 0.1
"""What the first cycles take up for good is no leak."""

LONG_AWAY_EVERY = 100
LONG_AWAY_S = 5.0
"""Now and then it stays away until all pauses between attempts have grown."""

PATIENCE_S = 10.0
STATES = ("idle", "in a frame", "commands unread")

CONFIG = """
[finger.left.wrench]
device = "bota"
port = "{port}"
rate_hz = 1000.0
"""


class Plug:
    """The device's end of a pseudo-terminal that comes and goes under one path."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._fd = -1

    def plug(self) -> None:
        self._fd, other = os.openpty()
        tty.setraw(other)
        os.set_blocking(self._fd, False)
        self.path.symlink_to(os.ttyname(other))
        os.close(other)

    def unplug(self) -> None:
        self.path.unlink()
        os.close(self._fd)

    def send(self, data: bytes) -> None:
        os.write(self._fd, data)


def run(folder: Path, *, quick: bool) -> list[Table]:
    """Measure."""
    return asyncio.run(_run(folder, QUICK_CYCLES if quick else CYCLES))


async def _run(folder: Path, cycles: int) -> list[Table]:
    plug = Plug(folder / "bota")
    rng = random.Random(1)
    noticed_ms: dict[str, list[float]] = {state: [] for state in STATES}
    reopened_ms: dict[str, list[float]] = {"short": [], "long": []}
    before = after = None
    async with running(folder, CONFIG.format(port=plug.path)) as (_, told):
        for cycle in range(cycles):
            long = cycle % LONG_AWAY_EVERY == LONG_AWAY_EVERY - 1
            await asyncio.sleep(LONG_AWAY_S if long else rng.uniform(0.02, 0.3))
            state = STATES[cycle % len(STATES)]
            reopened_ms["long" if long else "short"].append(await _plugged(plug, told))
            await _talk(plug, state)
            noticed_ms[state].append(await _unplugged(plug, told))
            if before is None and cycle >= WARM_UP_SHARE * cycles:
                before = Holdings.now()
        await asyncio.sleep(0.5)
        after = Holdings.now()
    assert before is not None
    return [_times(noticed_ms, reopened_ms), _holdings(before, after, cycles)]


async def _plugged(plug: Plug, told: Told) -> float:
    """Plug in; milliseconds until the daemon has opened it."""
    begin_ns = time.monotonic_ns()
    plug.plug()
    await _until(told, lambda: told.opened_ns > begin_ns)
    return (told.opened_ns - begin_ns) * 1e-6


async def _unplugged(plug: Plug, told: Told) -> float:
    """Pull; milliseconds until the daemon has told it."""
    begin_ns = time.monotonic_ns()
    plug.unplug()
    await _until(told, lambda: told.lost_ns > begin_ns)
    return (told.lost_ns - begin_ns) * 1e-6


async def _until(told: Told, condition: object) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not condition():  # type: ignore[operator]
            told.changed.clear()
            await told.changed.wait()


async def _talk(plug: Plug, state: str) -> None:
    """Some readings, and what the state asks for. The session's commands are never read."""
    frames = [bota.encode_frame((0.1, 0.2, 0.3), (0.0, 0.0, 0.0), n * 1000) for n in range(20)]
    plug.send(b"".join(frames))
    await asyncio.sleep(0.005)
    if state == "in a frame":
        plug.send(frames[0][:11])
        await asyncio.sleep(0.002)
    elif state == "commands unread":
        await asyncio.sleep(0.02)


def _times(noticed_ms: dict[str, list[float]], reopened_ms: dict[str, list[float]]) -> Table:
    table = Table("Unplugging: times in ms", ("what", "times", "p50", "p99", "most"))
    for state, values in noticed_ms.items():
        table.rows.append((f"noticed, {state}", *_figures(values)))
    for away, values in reopened_ms.items():
        if values:
            table.rows.append((f"reopened, {away} away", *_figures(values)))
    table.notes += [
        "Noticed: from the end of the pseudo-terminal to the report of the daemon; wanted: at most 5 ms.",
        "Reopened: from its return under the same path until the daemon has opened it; wanted: at most 100 ms.",
    ]
    if reopened_ms["long"]:
        table.notes.append(
            f"Long: {LONG_AWAY_S:g} s, after which the pauses between attempts have grown to their longest."
        )
    return table


def _figures(values: list[float]) -> tuple[int, float, float, float]:
    return len(values), float(np.percentile(values, 50)), float(np.percentile(values, 99)), max(values)


def _holdings(before: Holdings, after: Holdings, cycles: int) -> Table:
    table = Table(f"Unplugging: what {cycles} cycles leave behind", ("what", "before", "after", "more"))
    table.rows += [
        ("memory, kB", before.memory_kb, after.memory_kb, after.memory_kb - before.memory_kb),
        ("open files", before.files, after.files, after.files - before.files),
        ("tasks", before.tasks, after.tasks, after.tasks - before.tasks),
    ]
    table.notes.append(f"Before: after the first {100 * WARM_UP_SHARE:g} % of the cycles.")
    return table
