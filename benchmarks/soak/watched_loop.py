"""A loop that watches itself: how late it runs, and, with a config, what the daemon on it holds.

    python -m soak.watched_loop FOLDER SECONDS [CONFIG]

With a config the endpoints are printed first. In the end one line of JSON: `Watched`.
"""

from __future__ import annotations

import asyncio
import json
import sys
from array import array
from contextlib import AsyncExitStack
from dataclasses import asdict, dataclass
from pathlib import Path

from soak.inside import Holdings, running

PROBE_S = 0.005
BIN_S = 10e-6
BINS = 100_000
"""Of the histogram, up to 1 s: a list of all the times would grow by as much as a leak."""

SAMPLE_S = 10.0


@dataclass
class Watched:
    """What was seen.

    Attributes:
        lag_ms: How late the probe ran: median, 99 %, 99.9 % and most, ms.
        holdings: Memory (kB), open files and tasks, every 10 s.
    """

    lag_ms: list[float]
    holdings: list[tuple[int, int, int]]


class Lags:
    """Histogram of how late a task runs that is due every `PROBE_S`."""

    def __init__(self) -> None:
        self._counts = array("Q", bytes(8 * BINS))
        self._most_s = 0.0

    async def watch(self) -> None:
        """Count until cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            due_s = loop.time() + PROBE_S
            await asyncio.sleep(PROBE_S)
            late_s = max(0.0, loop.time() - due_s)
            self._counts[min(int(late_s / BIN_S), BINS - 1)] += 1
            self._most_s = max(self._most_s, late_s)

    def quantile_ms(self, share: float) -> float:
        """Return the lag that a share of the runs does not exceed, ms."""
        rest = share * sum(self._counts)
        for number, count in enumerate(self._counts):
            rest -= count
            if rest <= 0:
                return 1e3 * BIN_S * (number + 1)
        return 0.0

    @property
    def figures_ms(self) -> list[float]:
        """Median, 99 %, 99.9 % and most, ms."""
        return [*map(self.quantile_ms, (0.5, 0.99, 0.999)), 1e3 * self._most_s]


async def _watch(folder: Path, seconds: float, config: str | None) -> Watched:
    lags, holdings = Lags(), []
    async with AsyncExitStack() as stack:
        if config is not None:
            endpoints, _ = await stack.enter_async_context(running(folder, config))
            print(f"publish: {endpoints.publish}\nrequests: {endpoints.requests}", flush=True)
        probe = asyncio.create_task(lags.watch())
        end_s = asyncio.get_running_loop().time() + seconds
        while (left_s := end_s - asyncio.get_running_loop().time()) > 0.0:
            await asyncio.sleep(min(SAMPLE_S, left_s))
            held = Holdings.now(collected=False)
            holdings.append((held.memory_kb, held.files, held.tasks))
        probe.cancel()
    return Watched(lags.figures_ms, holdings)


def main() -> None:
    """Watch, and print."""
    folder, seconds = Path(sys.argv[1]), float(sys.argv[2])
    config = Path(sys.argv[3]).read_text(encoding="utf-8") if sys.argv[3:] else None
    print(f"watched {json.dumps(asdict(asyncio.run(_watch(folder, seconds, config))))}", flush=True)


if __name__ == "__main__":
    main()
