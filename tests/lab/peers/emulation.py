"""An emulated device on a real line, served by a thread while another program talks to it."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np

from slipd.sim.emulate import emulated
from slipd.sim.emulators import make_emulator

FORCE_N, TORQUE_NM = (3.0, -2.0, -11.0), (0.05, -0.03, 0.02)
"""Load on an emulated force/torque sensor; no two components agree in size or sign, so that no swap goes unseen."""


@contextlib.contextmanager
def device_at(device: str, address: str, **settings: Any) -> Iterator[Any]:
    """Serve an emulated device at ``address`` for the duration of ``with``; return its emulator.

    A force/torque sensor carries `FORCE_N` and `TORQUE_NM`.

    Raises:
        OSError: The address cannot be served.
    """
    emulator: Any = make_emulator(device, seed=1, **settings)
    if hasattr(emulator, "feel"):
        emulator.feel(np.array(FORCE_N), np.array(TORQUE_NM))
    loop, stop = asyncio.new_event_loop(), asyncio.Event()
    served: threading.Event = threading.Event()
    failed: list[Exception] = []

    async def serve() -> None:
        async with emulated([(device, emulator, address)]) as emulation:
            running = asyncio.create_task(emulation.run())
            served.set()
            await stop.wait()
            running.cancel()

    def run() -> None:
        try:
            loop.run_until_complete(serve())
        except Exception as error:  # raised again in the thread that waits
            failed.append(error)
            served.set()

    thread = threading.Thread(target=run, name=f"emulated {device}")
    thread.start()
    served.wait()
    if failed:
        raise failed[0]
    try:
        yield emulator
    finally:
        loop.call_soon_threadsafe(stop.set)
        thread.join()
