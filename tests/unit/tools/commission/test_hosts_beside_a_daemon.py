"""A host of the guide beside a real daemon: readings arrive, requests are carried out, and gravity is repeated."""

from __future__ import annotations

import asyncio
import json
import math
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from daemon_peers import Client
from rig_parts import PATIENCE_S
from service_rig import Rig, asked, serving

from slipd import config
from slipd.tools.commission import commission_command
from slipd.tools.commission.commission_command import PageHost, TerminalHost
from slipd.tools.commission.daemon_link import DaemonLink, GravitySender
from slipd.tools.commission.dialogue import Ask, Event, Refusal
from slipd_client.messages.topics import Wrench

pytestmark = pytest.mark.usefixtures("person")


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(tmp_path / "run"))


@asynccontextmanager
async def daemon_of_a_heavy_finger(folder: Path) -> AsyncIterator[tuple[config.Config, Client]]:
    """Run a daemon whose sensors send all the time."""
    rig = Rig(folder)
    text = rig.file.read_text(encoding="utf-8").replace('device = "bota"', 'device = "bota"\nmass_kg = 0.1')
    rig.file.write_text(text, encoding="utf-8")

    async def send() -> None:
        while True:
            rig.send()
            await asyncio.sleep(0.01)

    async with serving(rig.config) as daemon:
        sending = asyncio.create_task(send())
        try:
            yield rig.config, daemon
        finally:
            sending.cancel()
            await asyncio.wait([sending])


async def until_gravity_is(daemon: Client, state: str) -> None:
    """Wait until the status of the daemon says so; a request that comes too late is repeated."""
    async with asyncio.timeout(PATIENCE_S):
        while True:
            result = (await asked(daemon, "status")).get("result")
            if result is not None and result["streams"]["left.wrench"]["gravity"] == state:
                return
            await asyncio.sleep(0.02)


async def test_gravity_is_repeated_until_another_is_told_or_none(tmp_path: Path) -> None:
    async with daemon_of_a_heavy_finger(tmp_path) as (_, daemon):
        sender = GravitySender(daemon.endpoints.requests, None)
        try:
            sender.start({"left": (9.81, 0.0, 0.0)})
            await until_gravity_is(daemon, "compensated")
            await asyncio.to_thread(sender.start, {"left": (0.0, 9.81, 0.0)})
            await until_gravity_is(daemon, "compensated")
            await asyncio.to_thread(sender.start, {})
            await until_gravity_is(daemon, "unknown_orientation")
        finally:
            await asyncio.to_thread(sender.stop)


async def hosted(
    kind: type[TerminalHost], rig: config.Config, daemon: Client, work: Callable[[TerminalHost], list[Event]]
) -> list[Event]:
    """Let a host work in a thread of its own, and return the events."""
    link = DaemonLink(daemon.endpoints.publish, daemon.endpoints.requests, None, None)

    def run() -> list[Event]:
        with kind(Path("rig.toml"), rig.text, link, write=False) as host:
            return work(host)

    return await asyncio.to_thread(run)


@pytest.mark.parametrize("least_s", [0.0, math.inf])
async def test_readings_reach_the_guide_and_the_page_as_often_as_stated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], least_s: float
) -> None:
    monkeypatch.setattr(commission_command, "LIVE_S", least_s)

    def listen(host: TerminalHost) -> list[Event]:
        """Return some readings."""
        readings: list[Event] = []
        until_s = time.monotonic() + PATIENCE_S
        while len(readings) < 5:
            assert time.monotonic() < until_s
            readings += [event for event in (host.respond(None),) if isinstance(event, Wrench)]
        return readings

    async with daemon_of_a_heavy_finger(tmp_path) as (rig, daemon):
        readings: list[Any] = await hosted(PageHost, rig, daemon, listen)
    shown = [json.loads(line)["live"]["left"] for line in capsys.readouterr().out.splitlines()]
    told = [(each.force_n, each.torque_nm) for each in readings if least_s == 0.0]
    assert shown == json.loads(json.dumps(told))


async def test_a_request_is_carried_out_with_a_lease_where_it_needs_one(tmp_path: Path) -> None:
    def work(host: TerminalHost) -> list[Event]:
        until_s = time.monotonic() + PATIENCE_S
        answers = [host.respond(Ask("friction_set", {"finger": "left", "mu_s": 0.6}))]
        while isinstance(answers[-1], Refusal):
            assert time.monotonic() < until_s, answers
            answers.append(host.respond(Ask("friction_set", {"finger": "left", "mu_s": 0.6}, lease=True)))
        return answers

    async with daemon_of_a_heavy_finger(tmp_path) as (rig, daemon):
        answers: list[Any] = await hosted(TerminalHost, rig, daemon, work)
    assert isinstance(answers[0], Refusal), "without a lease"
    assert answers[-1].result.mu == 0.6
