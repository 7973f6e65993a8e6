"""Ticks after a stall report unread lines until every line has been read."""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Callable

import pytest

from slipd.events import Tick
from slipd.finger.freshness import LATE_NS
from slipd.io.ticker import Ticker

WAITING = 200
PATIENCE_S = 30.0


class Line:
    """A line that is read one byte per turn of the loop, and the ticks in the meantime."""

    def __init__(self) -> None:
        self.taken = 0
        self.ticks: list[tuple[int, Tick, int]] = []  # time, tick, bytes read until then
        self._read_fd, self._write_fd = os.pipe()
        asyncio.get_running_loop().add_reader(self._read_fd, self._read)

    def send(self, count: int) -> None:
        os.write(self._write_fd, b"x" * count)

    def tick(self, tick: Tick, t_ns: int) -> None:
        self.ticks.append((t_ns, tick, self.taken))

    def close(self) -> None:
        asyncio.get_running_loop().remove_reader(self._read_fd)
        os.close(self._read_fd)
        os.close(self._write_fd)

    def _read(self) -> None:
        self.taken += len(os.read(self._read_fd, 1))


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not condition():  # noqa: ASYNC110 - there is no event
            await asyncio.sleep(0.001)


async def test_C4_after_a_stall_lines_count_as_read_only_when_all_waiting_bytes_were_read() -> None:
    line = Line()
    ticker = asyncio.create_task(Ticker(line.tick, lambda: line.taken, 0).run())
    await until(lambda: len(line.ticks) >= 3)
    line.send(WAITING)
    time.sleep(0.05)  # noqa: ASYNC251 - the loop stands still
    before = len(line.ticks)
    await until(lambda: any(not tick.unread for _, tick, _ in line.ticks[before:]))
    ticker.cancel()
    line.close()
    late = [at for at in range(1, len(line.ticks)) if line.ticks[at][0] - line.ticks[at - 1][0] > LATE_NS]
    assert late, "the loop stalled"
    assert all(line.ticks[at][1].unread for at in late)
    vouched = next(taken for _, tick, taken in line.ticks[before:] if not tick.unread)
    assert vouched == WAITING


async def test_the_ticks_report_a_step_of_the_wall_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    line = Line()
    monkeypatch.setattr(time, "time_ns", lambda: time.monotonic_ns() + 10**18)
    ticker = asyncio.create_task(Ticker(line.tick, lambda: 0, 10**18).run())
    await until(lambda: len(line.ticks) >= 3)
    moved_ns = 10**18 + 8 * 3600 * 10**9
    monkeypatch.setattr(time, "time_ns", lambda: time.monotonic_ns() + moved_ns)
    await until(lambda: line.ticks[-1][1].wall_minus_monotonic_ns != 0)
    before = len(line.ticks)
    await until(lambda: len(line.ticks) >= before + 3)
    ticker.cancel()
    line.close()
    assert {tick.wall_minus_monotonic_ns for _, tick, _ in line.ticks[:3]} == {0}
    reported = {tick.wall_minus_monotonic_ns for _, tick, _ in line.ticks[before:]}
    assert len(reported) == 1
    assert reported.pop() == pytest.approx(moved_ns, abs=10**6)


async def test_C4_P3_a_line_that_is_never_empty_never_counts_as_read() -> None:
    line = Line()
    taken = iter(range(10**9))  # something enters in every turn
    ticker = asyncio.create_task(Ticker(line.tick, lambda: next(taken), 0).run())
    await until(lambda: len(line.ticks) >= 3)
    time.sleep(0.05)  # noqa: ASYNC251 - the loop stands still
    before = len(line.ticks)
    await until(lambda: len(line.ticks) >= before + 5)
    ticker.cancel()
    line.close()
    assert [tick.unread for _, tick, _ in line.ticks[before:]] == [True] * (len(line.ticks) - before)
