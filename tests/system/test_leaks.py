"""A daemon that runs for weeks keeps its descriptors and tasks."""

from __future__ import annotations

import asyncio
import gc

from loop_waits import eventually, open_files
from service_rig import Rig, serving


async def test_P6_runs_that_end_leave_no_descriptor_and_no_task(rig: Rig) -> None:
    """As after each reload of the config."""
    found = []
    for _ in range(3):
        async with serving(rig.config) as client:
            await eventually(lambda client=client: client.hear("wrench.left"), rig.send)  # type: ignore[misc]
        gc.collect()
        found.append((open_files(), len(asyncio.all_tasks())))
    assert found[2] == found[1]
