"""Signals to a running daemon, handled on its event loop, and the config that is read again at SIGHUP."""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import logging
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import FrameType

from slipd.config import Config, load
from slipd.errors import ConfigError
from slipd.events import Event, HostNotice

READ_LIMIT_S = 5.0
"""Longest wait for the disk, s; the config before is then kept."""
_log = logging.getLogger(__name__)


def reload_requests() -> asyncio.Event | None:
    """Return the event that SIGHUP sets until the running loop is closed; None where SIGHUP must not reload.

    Under ``nohup`` it stays ignored. From a terminal as standard input, it says that the terminal was closed. In a
    thread other than the main one nothing is handled: the owner of the main thread ends the run.
    """
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN or (sys.stdin is not None and sys.stdin.isatty()):
        return None
    requested = asyncio.Event()
    with contextlib.suppress(ValueError, RuntimeError):
        asyncio.get_running_loop().add_signal_handler(signal.SIGHUP, requested.set)
    return requested


class EndSignals(contextlib.ExitStack):
    """Signals that end the daemon, handled until the ``with`` block ends.

    A signal is remembered even while the loop stands still, as when a run closes its recordings. Signals that are
    ignored stay so, and outside the main thread nothing is handled.

    Args:
        numbers: The signals.

    Attributes:
        received: Whether one has come.
    """

    def __init__(self, *numbers: signal.Signals) -> None:
        super().__init__()
        self.received = False
        self._numbers = [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]

    def handle(self, stop: asyncio.Event) -> None:
        """Set ``stop`` at each signal from now on, and at once if one has come; earlier events are forgotten."""
        self._loop, self._stop = asyncio.get_running_loop(), stop
        if self.received:
            stop.set()
        while self._numbers:
            number = self._numbers.pop()
            with contextlib.suppress(ValueError):
                self.callback(signal.signal, number, signal.signal(number, self._on_signal))

    def _on_signal(self, _: int, __: FrameType | None) -> None:
        self.received = True
        self._loop.call_soon_threadsafe(self._stop.set)


async def changed_config(
    file: Path, requested: asyncio.Event, config: Config, report: Callable[[Event], None]
) -> Config:
    """Read a config file at each request, until it holds another config without faults; return that.

    Args:
        file: The file.
        requested: Set by each request.
        config: The config in use.
        report: Called with a notice of the faults, or of their end.
    """
    while True:
        await requested.wait()
        requested.clear()
        fault: Exception | None = None
        try:
            async with asyncio.timeout(READ_LIMIT_S):
                found = await _read(file)
        except TimeoutError:
            why = f"cannot be read within {READ_LIMIT_S:g} s: is it a pipe, or on a disk that hangs?"
            fault = RuntimeError(f"{file}: {why}")
        except ConfigError as error:
            fault = error
        except Exception as error:  # an error in a check must not end a run that holds something
            fault = RuntimeError(f"{file}: {type(error).__name__}: {error}")
        if fault is not None:
            _log.error("%s", kept_text(fault), extra={"slipd_fault": "config-kept"})
            report(HostNotice("config", kept_text(fault)))
        elif found.text == config.text:
            _log.info("%s: not changed", file)
            report(HostNotice("config", ""))
        else:
            return found


async def _read(file: Path) -> Config:
    """Read a file on a thread that nothing waits for: neither a later request nor the end of the daemon."""
    found: concurrent.futures.Future[Config] = concurrent.futures.Future()
    found.set_running_or_notify_cancel()  # from here on, giving up waiting does not cancel it

    def read() -> None:
        try:
            found.set_result(load(file))
        except Exception as error:
            found.set_exception(error)

    threading.Thread(target=read, name="config", daemon=True).start()
    return await asyncio.wrap_future(found)


def kept_text(error: Exception) -> str:
    """Return that the config is kept because of an error, with the first line of the error."""
    first, *more = str(error).splitlines()
    others = f" (and {len(more)} more; slipd check lists them)" if more else ""
    return f"the config read before is kept: {first}{others}"
