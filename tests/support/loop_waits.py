"""What tests of one event loop share: bounded waits, open files, and the faults that reached the loop."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest

PATIENCE_S = 60.0


async def eventually(condition: Callable[[], Any], meanwhile: Callable[[], object] = lambda: None) -> Any:
    """Wait until a condition holds, and return its value."""
    async with asyncio.timeout(PATIENCE_S):
        while not (found := condition()):
            meanwhile()
            await asyncio.sleep(0.001)
        return found


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
