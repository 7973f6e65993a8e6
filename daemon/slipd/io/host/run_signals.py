"""Signals to a running daemon, handled on its event loop."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections.abc import Callable, Iterator, Mapping
from types import FrameType
from typing import Any, Self


@contextlib.contextmanager
def handled_signals(handlers: Mapping[signal.Signals, Callable[[], None]]) -> Iterator[None]:
    """Call the handlers on the running loop for the duration of ``with``.

    A signal that is ignored, such as SIGHUP under ``nohup``, stays ignored. In a thread other than the main one nothing
    is handled: the owner of the main thread ends the run.

    Args:
        handlers: What each signal calls.
    """
    loop = asyncio.get_running_loop()
    numbers = [number for number in handlers if signal.getsignal(number) is not signal.SIG_IGN]
    for number in numbers:
        with contextlib.suppress(ValueError, RuntimeError):
            loop.add_signal_handler(number, handlers[number])
    try:
        yield
    finally:
        for number in numbers:
            with contextlib.suppress(ValueError, RuntimeError):
                loop.remove_signal_handler(number)


class EndSignals:
    """Signals that end the daemon, handled until the ``with`` block ends.

    A signal is remembered even while the loop stands still, as when a run closes its recordings. Signals that are
    ignored stay so, and outside the main thread nothing is handled.

    Args:
        numbers: The signals.

    Attributes:
        received: Whether one has come.
    """

    def __init__(self, *numbers: signal.Signals) -> None:
        self.received = False
        self._numbers = numbers
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def handle(self, stop: asyncio.Event) -> None:
        """Set ``stop`` at each signal from now on, and at once if one has come; earlier events are forgotten."""
        self._loop, self._stop = asyncio.get_running_loop(), stop
        if self.received:
            stop.set()
        for number in self._numbers:
            if number not in self._before and signal.getsignal(number) is not signal.SIG_IGN:
                with contextlib.suppress(ValueError):
                    self._before[number] = signal.signal(number, self._on_signal)

    def _on_signal(self, _: int, __: FrameType | None) -> None:
        self.received = True
        self._loop.call_soon_threadsafe(self._stop.set)
