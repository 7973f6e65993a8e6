"""Signals that end the daemon or let it read its config again: none is lost, and the run survives a broken config."""

from __future__ import annotations

import asyncio
import os
import signal
from pathlib import Path

import pytest
from config_faults import GOOD
from loop_waits import PATIENCE_S, eventually

from slipd import config
from slipd.events import Event, HostNotice
from slipd.io import run_signals
from slipd.io.run_signals import EndSignals, changed_config


async def test_a_signal_that_comes_before_the_loop_runs_again_is_remembered() -> None:
    first, second, later = asyncio.Event(), asyncio.Event(), asyncio.Event()
    with EndSignals(signal.SIGTERM) as ends:
        ends.handle(first)
        ends.handle(second)
        signal.raise_signal(signal.SIGTERM)
        assert ends.received, "before the loop has run"
        await eventually(second.is_set)
        ends.handle(later)
        assert (first.is_set(), later.is_set()) == (False, True)


async def test_the_handlers_from_before_come_back_and_an_ignored_signal_stays_ignored() -> None:
    before = signal.getsignal(signal.SIGTERM)
    ignored = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with EndSignals(signal.SIGTERM, signal.SIGHUP) as ends:
            ends.handle(asyncio.Event())
            assert signal.getsignal(signal.SIGTERM) is not before
            signal.raise_signal(signal.SIGHUP)
            assert not ends.received
        assert (signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGHUP)) == (before, signal.SIG_IGN)
    finally:
        signal.signal(signal.SIGHUP, ignored)


class Run:
    """A run whose config may be read again."""

    def __init__(self, file: Path) -> None:
        self.file, self.reports, self.requested = file, list[Event](), asyncio.Event()
        file.write_text(GOOD, encoding="utf-8")
        self.changed = asyncio.create_task(changed_config(file, self.requested, config.load(file), self.reports.append))

    async def reported(self) -> Event:
        """Request to read the config, and return what is reported."""
        before = len(self.reports)
        self.requested.set()
        await eventually(lambda: len(self.reports) > before)
        return self.reports[-1]

    async def expect_change(self) -> None:
        """Request to read another config, which ends the run."""
        assert not self.changed.done()
        self.file.write_text(GOOD.replace("mu = 0.5", "mu = 0.4"), encoding="utf-8")
        self.requested.set()
        assert (await self.changed).finger["left"].mu == 0.4


@pytest.fixture
async def run(tmp_path: Path) -> Run:
    return Run(tmp_path / "rig.toml")


def kept(why: str) -> HostNotice:
    return HostNotice("config", f"the config read before is kept: {why}")


async def test_G2_a_check_that_fails_itself_keeps_the_run_and_is_reported(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: Path) -> config.Config:
        raise ZeroDivisionError("float division by zero")

    with monkeypatch.context() as broken:
        broken.setattr(run_signals, "load", fail)
        assert await run.reported() == kept(f"{run.file}: ZeroDivisionError: float division by zero")
    assert await run.reported() == HostNotice("config", "")
    await run.expect_change()


async def test_G2_a_file_that_cannot_be_read_in_time_keeps_the_run_and_the_next_request_counts(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_signals, "READ_LIMIT_S", 0.05)
    run.file.unlink()
    os.mkfifo(run.file)  # nobody writes to it
    why = f"{run.file}: cannot be read within 0.05 s: is it a pipe, or on a disk that hangs?"
    assert await run.reported() == kept(why)
    pipe = os.open(run.file, os.O_RDWR)  # the thread goes on, and its result comes too late
    os.close(pipe)
    run.file.unlink()
    monkeypatch.setattr(run_signals, "READ_LIMIT_S", PATIENCE_S)
    await run.expect_change()
