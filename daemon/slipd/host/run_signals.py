"""Signals to a running daemon, handled on its event loop."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections.abc import Callable, Iterator, Mapping


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
