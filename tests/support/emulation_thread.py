"""Emulated devices on their lines, in a thread of this process."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

from slipd.tools.sim import emulate
from slipd.tools.sim.emulators import Emulator, make_emulator


@contextmanager
def emulation(
    devices: list[tuple[str, Emulator, str]],
    advance: Callable[[int], object] = lambda _: None,
    tick_ns: int = 5_000_000,
) -> Iterator[None]:
    """Serve devices until the block ends; each is its name, its emulator and its address.

    Args:
        devices: The devices.
        advance: Told the time of the devices, ns, before each of their steps.
        tick_ns: Time between steps; the default is enough for 100 readings/s, and lighter than that of the command.
    """
    ready, ended = threading.Event(), threading.Event()

    async def serve() -> None:
        async with emulate.emulated(devices) as lines:
            running = asyncio.create_task(emulate.run(lines, advance))
            ready.set()
            await asyncio.to_thread(ended.wait)
            running.cancel()

    thread = threading.Thread(target=asyncio.run, args=(serve(),), name="emulation")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(emulate, "TICK_NS", tick_ns)
        thread.start()
        try:
            assert ready.wait(60.0)
            yield
        finally:
            ended.set()
            thread.join()


def plugged(folder: Path, *names: str) -> AbstractContextManager[None]:
    """Emulate devices on lines of their names until the block ends."""
    devices = [(name, make_emulator(name, 1), str(folder / name)) for name in names]
    return emulation(devices, tick_ns=1_000_000)
