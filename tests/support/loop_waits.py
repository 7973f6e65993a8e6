"""What tests of one event loop share: bounded waits, open files, and the faults that reached the loop."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest

PATIENCE_S = 60.0


async def eventually(condition: Callable[[], object]) -> None:
    """Wait until a condition holds."""
    async with asyncio.timeout(PATIENCE_S):
        while not condition():  # noqa: ASYNC110 - what it waits for happens in other threads and processes too
            await asyncio.sleep(0.001)


def open_files() -> int:
    """Return how many files this process has open."""
    return len(list(Path("/proc/self/fd").iterdir()))


@pytest.fixture
async def loop_faults() -> AsyncIterator[list[dict[str, Any]]]:
    """What reached the loop's exception handler; a daemon dies of any, so a test that expects some clears it."""
    faults: list[dict[str, Any]] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: faults.append(context))
    yield faults
    assert faults == []
