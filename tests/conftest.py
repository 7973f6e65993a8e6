"""Fixtures that every test gets."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest_asyncio


@pytest_asyncio.fixture(autouse=True)
async def _no_task_is_leaked() -> AsyncIterator[None]:
    """Fails a test that leaves an asyncio task pending behind it."""
    before = asyncio.all_tasks()
    yield
    await asyncio.sleep(0)
    leaked = {task for task in asyncio.all_tasks() - before if not task.done()} - {asyncio.current_task()}
    names = sorted(task.get_name() for task in leaked)
    assert not leaked, f"tasks left pending: {names}"
