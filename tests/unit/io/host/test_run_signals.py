"""Signals that end the daemon: none is lost, and the process gets its own handlers back."""

from __future__ import annotations

import asyncio
import signal

from slipd.io.host.run_signals import EndSignals


async def test_a_signal_that_comes_before_the_loop_runs_again_is_remembered() -> None:
    first, second = asyncio.Event(), asyncio.Event()
    with EndSignals(signal.SIGTERM) as ends:
        ends.handle(first)
        ends.handle(second)
        signal.raise_signal(signal.SIGTERM)
        assert ends.received, "before the loop has run"
        await asyncio.wait_for(second.wait(), 10.0)
        assert not first.is_set()
        later = asyncio.Event()
        ends.handle(later)
        assert later.is_set()


async def test_the_handlers_from_before_come_back_and_an_ignored_signal_stays_ignored() -> None:
    before = signal.getsignal(signal.SIGTERM)
    ignored = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with EndSignals(signal.SIGTERM, signal.SIGHUP) as ends:
            ends.handle(asyncio.Event())
            assert signal.getsignal(signal.SIGTERM) is not before
            signal.raise_signal(signal.SIGHUP)
            assert not ends.received
        assert signal.getsignal(signal.SIGTERM) is before
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, ignored)
