"""One run of the service: what a failure ends, and what a step of the wall clock changes."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest
import pytest_asyncio
from engine_rig import RIG
from nanoseconds import T0

from slipd import config
from slipd.events import Bytes, LinkUp, Tick
from slipd.service_run import ServiceRun

BUS = """
[bus]
publish = "ipc://{folder}/publish"
requests = "ipc://{folder}/requests"
"""


class Wires:
    """What reaches the devices."""

    def __init__(self) -> None:
        self.written: list[str] = []

    def write(self, link: str, data: bytes) -> None:
        assert data
        self.written.append(link)


@pytest_asyncio.fixture
async def run(tmp_path: Path) -> AsyncIterator[ServiceRun]:
    settings = config.parse(RIG + BUS.format(folder=tmp_path), "rig.toml")
    with ServiceRun(settings, None, asyncio.Event(), lambda _: None, lambda: T0) as run:
        run.open()
        run.links = Wires()  # type: ignore[assignment]
        yield run


def written(run: ServiceRun) -> list[str]:
    assert isinstance(run.links, Wires)
    return run.links.written


def fail_in_the_loop(run: ServiceRun) -> None:
    for context in ({"message": "a callback failed", "exception": ValueError("first")}, {"message": "another"}):
        run.on_loop_fault(asyncio.get_running_loop(), context)


@pytest.mark.parametrize(
    ("fail", "error"),
    [(lambda run: run.handle(Bytes("no such link", b"")), "no such link"), (fail_in_the_loop, "first")],
    ids=["of the engine", "of the loop"],
)
async def test_after_a_failure_nothing_reaches_a_device(
    run: ServiceRun, fail: Callable[[ServiceRun], None], error: str
) -> None:
    run.handle(LinkUp("gripper", "port"))
    fail(run)
    for t_ns in range(T0, T0 + 10**9, 10**7):  # events of the same turn of the loop
        run.handle(LinkUp("gripper", "port"), t_ns)
        run.tick(Tick(), t_ns)
    run.end()
    assert written(run) == ["gripper"]
    with pytest.raises((KeyError, ValueError), match=error):
        run.raise_failure()
