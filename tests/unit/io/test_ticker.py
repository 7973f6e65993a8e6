"""Ticks after a stall report unread lines until every line has been read."""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from itertools import pairwise
from typing import Any

import pytest
from loop_waits import eventually

from slipd.events import Tick
from slipd.finger.freshness import LATE_NS
from slipd.io.event_loop import TICK_S, Ticker

WAITING = 200


class Line:
    """A line that is read one byte per turn of the loop, and the ticks in the meantime."""

    def __init__(self) -> None:
        self.taken = 0
        self.ticks: list[tuple[int, Tick, int]] = []  # time, tick, bytes read until then
        self.read_fd, self.write_fd = os.pipe()

    def read(self) -> None:
        self.taken += len(os.read(self.read_fd, 1))

    def tick(self, tick: Tick, t_ns: int) -> None:
        self.ticks.append((t_ns, tick, self.taken))

    async def some_ticks(self, count: int = 3) -> int:
        """Wait for some ticks, and return how many there are."""
        before = len(self.ticks)
        await eventually(lambda: len(self.ticks) >= before + count)
        return len(self.ticks)


@asynccontextmanager
async def ticking(event_count: Callable[[], int] | None = None, begun_ns: int = 0) -> AsyncIterator[Line]:
    line = Line()
    asyncio.get_running_loop().add_reader(line.read_fd, line.read)
    ticker = asyncio.create_task(Ticker(line.tick, event_count or (lambda: line.taken), begun_ns).run())
    await line.some_ticks()
    yield line
    ticker.cancel()
    asyncio.get_running_loop().remove_reader(line.read_fd)
    os.close(line.read_fd)
    os.close(line.write_fd)


async def test_C4_after_a_stall_lines_count_as_read_only_when_all_waiting_bytes_were_read() -> None:
    async with ticking() as line:
        os.write(line.write_fd, b"x" * WAITING)
        time.sleep(0.05)  # noqa: ASYNC251 - the loop stands still
        before = len(line.ticks)
        await eventually(lambda: any(not tick.unread for _, tick, _ in line.ticks[before:]))
    late = [now[1].unread for last, now in pairwise(line.ticks) if now[0] - last[0] > LATE_NS]
    assert set(late) == {True}, "the loop stalled"
    assert next(taken for _, tick, taken in line.ticks[before:] if not tick.unread) == WAITING


async def test_the_ticks_report_a_step_of_the_wall_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    begun_ns, moved_ns = 10**18, 10**18 + 8 * 3600 * 10**9
    monkeypatch.setattr(time, "time_ns", lambda: time.monotonic_ns() + begun_ns)
    async with ticking(begun_ns=begun_ns) as line:
        assert {tick.wall_minus_monotonic_ns for _, tick, _ in line.ticks} == {0}
        monkeypatch.setattr(time, "time_ns", lambda: time.monotonic_ns() + moved_ns)
        await eventually(lambda: line.ticks[-1][1].wall_minus_monotonic_ns != 0)
        before = len(line.ticks)
        await line.some_ticks()
    (reported,) = {tick.wall_minus_monotonic_ns for _, tick, _ in line.ticks[before:]}
    assert reported == pytest.approx(moved_ns, abs=10**6)


async def test_C4_P3_a_line_that_is_never_empty_never_counts_as_read() -> None:
    async with ticking(iter(range(10**9)).__next__) as line:  # something enters in every turn
        time.sleep(0.05)  # noqa: ASYNC251 - the loop stands still
        before = len(line.ticks)
        await line.some_ticks(5)
    assert {tick.unread for _, tick, _ in line.ticks[before:]} == {True}


async def test_a_tick_that_fails_reaches_the_handler_of_the_loop_and_is_the_last(
    loop_faults: list[dict[str, Any]],
) -> None:
    def fail(tick: Tick, _: int) -> None:
        ticks.append(tick)
        raise ValueError("failed")

    ticks: list[Tick] = []
    ticker = asyncio.create_task(Ticker(fail, lambda: 0, 0).run())
    await eventually(lambda: bool(loop_faults))
    await asyncio.sleep(4 * TICK_S)
    ticker.cancel()
    assert (len(ticks), str(loop_faults.pop()["exception"])) == (1, "failed")
