"""A request to read the config again, and what becomes of the run."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

import pytest
from config_faults import GOOD
from daemon_peers import PATIENCE_S, until

from slipd import config
from slipd.events import Event, HostNotice
from slipd.io.host import run_signals
from slipd.io.host.run_signals import ConfigReload


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
        broken.setattr(run_signals, "load", fail)
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


async def test_G2_a_file_that_cannot_be_read_in_time_keeps_the_run_and_the_next_request_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_signals, "READ_LIMIT_S", 0.05)
    file, reports = tmp_path / "rig.toml", list[Event]()
    file.write_text(GOOD, encoding="utf-8")
    config_in_use = config.load(file)
    requested, stop = asyncio.Event(), asyncio.Event()
    watch = asyncio.create_task(ConfigReload(file, requested).watch(config_in_use, reports.append, stop))
    file.unlink()
    os.mkfifo(file)  # nobody writes to it
    requested.set()
    await until(lambda: reports)
    why = f"{file}: cannot be read within 0.05 s: is it a pipe, or on a disk that hangs?"
    assert reports == [HostNotice("config", f"the config read before is kept: {why}")]
    pipe = os.open(file, os.O_RDWR)  # the thread goes on, and its result comes too late
    os.close(pipe)
    file.unlink()
    monkeypatch.setattr(run_signals, "READ_LIMIT_S", PATIENCE_S)
    file.write_text(GOOD.replace("mu = 0.5", "mu = 0.4"), encoding="utf-8")
    requested.set()
    await watch
    assert stop.is_set()
