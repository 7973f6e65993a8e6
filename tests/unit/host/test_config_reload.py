"""A request to read the config again, and what becomes of the run."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from config_faults import GOOD
from daemon_peers import until

from slipd import config
from slipd.events import Event, HostNotice
from slipd.host import config_reload
from slipd.host.config_reload import ConfigReload


async def test_G2_a_check_that_fails_itself_keeps_the_run_and_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, reports = tmp_path / "rig.toml", list[Event]()
    file.write_text(GOOD, encoding="utf-8")
    config_in_use = config.load(file)
    requested, stop = asyncio.Event(), asyncio.Event()
    reload = ConfigReload(file, requested)

    def fail(_: Path) -> config.Config:
        raise ZeroDivisionError("float division by zero")

    with monkeypatch.context() as broken:
        broken.setattr(config_reload, "load", fail)
        watch = asyncio.create_task(reload.watch(config_in_use, reports.append, stop))
        requested.set()
        await until(lambda: reports)
    text = f"the config read before is kept: {file}: ZeroDivisionError: float division by zero"
    assert (reports, stop.is_set()) == ([HostNotice("config", text)], False)

    requested.set()
    await until(lambda: len(reports) > 1)
    assert (reports[-1], reload.found) == (HostNotice("config", ""), None), "not changed"
    file.write_text(GOOD.replace("mu = 0.5", "mu = 0.4"), encoding="utf-8")
    requested.set()
    await watch
    assert stop.is_set()
    assert reload.found is not None
    assert reload.found.finger["left"].mu == 0.4
