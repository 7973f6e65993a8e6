"""Load the kernels from Numba's cache, or compile them and show the progress; also ``python -m`` this module."""

from __future__ import annotations

import contextlib
import gc
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Any

from numba.core import event

from slipd.engine.warm_up import warm_up
from slipd.fusion.compiled import KERNELS, PARTS
from slipd.io.progress import Progress
from slipd_client.terminal import INTERRUPTED

PURPOSE = "compiling kernels, once"

COLLECT_EVERY = 50_000
"""New objects between two runs of the garbage collector: the compiler leaves next to nothing to collect, and at the
default threshold of Python the collector takes a fifteenth of the time."""


def compile_kernels() -> None:
    """Get every kernel ready; where the cache lacks some, show the progress on standard error.

    Raises:
        KeyboardInterrupt: SIGINT came, and is not ignored.
    """
    shown, collections = _Compilation(), gc.get_threshold()
    gc.set_threshold(COLLECT_EVERY)
    with interruptible():
        try:
            with event.install_listener("numba:compile", shown):
                warm_up()
        finally:
            gc.set_threshold(*collections)
            shown.progress.erase()


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Let Ctrl-C end a block that loads or compiles kernels: between two passes of the compiler, or after the block.

    Numba takes kernels from its cache, and stores them there, in callbacks from C. An exception in one of those is
    printed and dropped: the program goes on, or ends with SIGSEGV because a kernel has no code.

    In other threads than the main one, and where SIGINT is ignored, nothing is handled.

    Raises:
        KeyboardInterrupt: SIGINT came.
    """
    before = signal.getsignal(signal.SIGINT)
    if before in (None, signal.SIG_IGN) or threading.current_thread() is not threading.main_thread():
        yield
        return
    interrupt = _Interrupt()
    signal.signal(signal.SIGINT, interrupt.receive)
    try:
        with event.install_listener("numba:run_pass", interrupt):
            yield
    finally:
        signal.signal(signal.SIGINT, before)
    interrupt.deliver()


class _Interrupt(event.Listener):
    """SIGINT, from its arrival to the next pass of the compiler."""

    def __init__(self) -> None:
        self._received = False

    def receive(self, *_: object) -> None:
        """Handle the signal."""
        self._received = True

    def deliver(self) -> None:
        """Raise KeyboardInterrupt where the signal came."""
        if self._received:
            raise KeyboardInterrupt

    def on_start(self, _: Any) -> None:
        """Deliver it before a pass."""
        self.deliver()

    def on_end(self, _: Any) -> None:
        """Do nothing: an exception here would replace that of the pass."""


class _Compilation(event.Listener):
    """Count the kernels that are compiled; Numba reports only those that its cache lacks."""

    def __init__(self) -> None:
        self._ready: set[str] = set()
        self.progress = Progress(lambda done, of: f"{PURPOSE}: {done} of {of}")
        self._announced = False

    def on_start(self, _: Any) -> None:
        """Announce the first kernel: with the bar, or as a line where no terminal can show it."""
        if self._announced:
            return
        self._announced = True
        self.progress.show(0, len(KERNELS) + len(PARTS))
        if not sys.stderr.isatty():
            print(f"{PURPOSE} (about a minute)", file=sys.stderr, flush=True)

    def on_end(self, compiled: Any) -> None:
        """Count a kernel that is ready."""
        function = compiled.data["dispatcher"].py_func
        if function.__module__.partition(".")[0] == "slipd":  # and not a function of NumPy that a kernel calls
            self._ready.add(f"{function.__module__}.{function.__qualname__}")
        self.progress.show(len(self._ready), len(KERNELS) + len(PARTS))


def main() -> int:
    """Get every kernel ready; return the exit code."""
    try:
        compile_kernels()
    except KeyboardInterrupt:
        return INTERRUPTED
    return 0


if __name__ == "__main__":
    sys.exit(main())
