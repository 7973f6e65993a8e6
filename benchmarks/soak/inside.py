"""The daemon within this process, so that its loop, memory and open files can be measured."""

from __future__ import annotations

import asyncio
import gc
import logging
import os
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from slipd import config
from slipd.service import serve
from slipd.service_run import Endpoints
from slipd_client.grip import GripClient

READY_S = 60.0
"""A cold cache compiles the kernels first."""


@dataclass
class Told(logging.Handler):
    """When the daemon said what of its links, as it does in its log, CLOCK_MONOTONIC.

    Attributes:
        opened_ns: Of the last "open"; 0 before.
        lost_ns: Of the last "the port is gone"; 0 before.
    """

    opened_ns: int = 0
    lost_ns: int = 0
    changed: asyncio.Event = field(default_factory=asyncio.Event)

    def __post_init__(self) -> None:
        super().__init__()

    def emit(self, record: logging.LogRecord) -> None:
        """Take note."""
        text = record.getMessage()
        if ": open (" in text:
            self.opened_ns = time.monotonic_ns()
            self.changed.set()
        elif "the port is gone" in text:
            self.lost_ns = time.monotonic_ns()
            self.changed.set()

    __hash__ = logging.Handler.__hash__


@asynccontextmanager
async def running(folder: Path, text: str) -> AsyncIterator[tuple[Endpoints, Told]]:
    """The daemon with a config, until the end of the ``with`` block."""
    path = folder / "rig.toml"
    path.write_text(text)
    ready: asyncio.Future[Endpoints] = asyncio.get_running_loop().create_future()
    stop, told, log = asyncio.Event(), Told(), logging.getLogger("slipd")
    log.addHandler(told)
    log.setLevel(logging.INFO)
    log.propagate = False
    serving = asyncio.create_task(serve(config.load(path), on_ready=ready.set_result, stop=stop))
    try:
        async with asyncio.timeout(READY_S):
            endpoints = await ready
        yield endpoints, told
    finally:
        stop.set()
        await serving
        log.removeHandler(told)


async def status(endpoints: Endpoints) -> dict[str, Any]:
    """What the daemon tells of itself; asked in a thread, since it answers in this one."""

    def ask() -> dict[str, Any]:
        with GripClient(endpoints.requests) as requester:
            return requester.status()

    return await asyncio.to_thread(ask)


@dataclass(frozen=True)
class Holdings:
    """What a process holds."""

    memory_kb: int
    files: int
    tasks: int

    @classmethod
    def now(cls, *, collected: bool = True) -> Holdings:
        """Of this process, after a collection of garbage if so asked."""
        if collected:
            gc.collect()
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmRSS:"):
                memory_kb = int(line.split()[1])
        return cls(memory_kb, len(os.listdir("/proc/self/fd")), len(asyncio.all_tasks()))  # noqa: PTH208
