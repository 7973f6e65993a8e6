"""A daemon that runs for weeks keeps its descriptors and tasks."""

from __future__ import annotations

import asyncio
import gc
from pathlib import Path

from daemon_peers import until
from service_rig import Rig, serving


def held() -> tuple[int, int]:
    return sum(1 for _ in Path("/proc/self/fd").iterdir()), len(asyncio.all_tasks())


async def test_P6_runs_that_end_leave_no_descriptor_and_no_task(rig: Rig) -> None:
    """As after each reload of the config."""
    found = []
    for _ in range(3):
        async with serving(rig.config) as client:
            await until(lambda client=client: client.hear("wrench.left"), rig.send)  # type: ignore[misc]
        gc.collect()
        found.append(held())
    assert found[2] == found[1]
