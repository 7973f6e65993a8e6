"""Emulated devices on real lines, beside what follows."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from slipd.tools.sim.emulate import emulated, emulator_for


@contextmanager
def plugged(folder: Path, *names: str) -> Iterator[None]:
    """Emulate devices on lines of their names until the block ends."""
    ready, ended = threading.Event(), threading.Event()

    async def serve() -> None:
        plan = [(name, emulator_for(name, str(folder / name), 1), str(folder / name)) for name in names]
        async with emulated(plan) as emulation:
            running = asyncio.create_task(emulation.run())
            ready.set()
            await asyncio.to_thread(ended.wait)
            running.cancel()

    thread = threading.Thread(target=lambda: asyncio.run(serve()))
    thread.start()
    try:
        assert ready.wait(60.0)
        yield
    finally:
        ended.set()
        thread.join()
