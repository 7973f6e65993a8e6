"""Emulated devices on their lines, in a thread of this process."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from slipd.tools.sim.emulate import emulated
from slipd.tools.sim.emulators import Emulator


@contextmanager
def emulation(devices: list[tuple[str, Emulator, str]], advance: Callable[[int], object]) -> Iterator[None]:
    """Serve devices until the block ends; each is its name, its emulator and its address.

    Args:
        devices: The devices.
        advance: Told the time of the devices, ns, before each of their steps.
    """
    ended = threading.Event()

    async def serve() -> None:
        async with emulated(devices, advance) as served:
            running = asyncio.create_task(served.run())
            await asyncio.to_thread(ended.wait)
            running.cancel()

    thread = threading.Thread(target=asyncio.run, args=(serve(),), name="emulation")
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
