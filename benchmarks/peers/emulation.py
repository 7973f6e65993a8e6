"""An emulated device on a real line, served by another process: a driver may hold the interpreter as it waits."""

from __future__ import annotations

import asyncio
import contextlib
import multiprocessing
from collections.abc import Iterator
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from slipd.tools.sim.emulate import emulated, run
from slipd.tools.sim.emulators import make_emulator

FORCE_N, TORQUE_NM = (3.0, -2.0, -11.0), (0.05, -0.03, 0.02)
"""Load on an emulated force/torque sensor; no two components agree in size or sign, so that no swap goes unseen."""


@contextlib.contextmanager
def device_at(device: str, address: str, part_m: float = 0.0, **settings: Any) -> Iterator[None]:
    """Serve an emulated device at ``address`` for the duration of ``with``.

    Args:
        device: Name in the list of devices. A force/torque sensor carries `FORCE_N` and `TORQUE_NM`.
        address: Path of a new pseudo-terminal, or a URL.
        part_m: Width of the part between the fingers of a gripper, m; 0: none.
        settings: Other arguments of the emulator.

    Raises:
        RuntimeError: The address cannot be served.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, device, address, part_m, settings))
    process.start()
    theirs.close()
    try:
        ours.recv()
    except EOFError:
        raise RuntimeError(f"{device} cannot be emulated at {address}; its process says why") from None
    try:
        yield
    finally:
        process.terminate()
        process.join()


def _serve(ready: Connection, device: str, address: str, part_m: float, settings: dict[str, Any]) -> None:
    emulator: Any = make_emulator(device, seed=1, **settings)
    if hasattr(emulator, "feel"):
        emulator.feel(np.array(FORCE_N), np.array(TORQUE_NM))
    if part_m:
        emulator.part_m = part_m

    async def serve() -> None:
        async with emulated([(device, emulator, address)]) as lines:
            ready.send("serving")
            await run(lines)

    asyncio.run(serve())
