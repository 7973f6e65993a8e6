"""Load the kernels from Numba's cache, or compile them and show how far that is; also ``python -m`` this module."""

from __future__ import annotations

import sys
from typing import Any

from numba.core import event

from slipd.engine.warm_up import warm_up
from slipd.fusion.compiled import KERNELS
from slipd.progress import Progress

PURPOSE = "compiling kernels, once"


def compile_kernels() -> None:
    """Get every kernel ready; where the cache lacks some, show the progress on standard error."""
    shown = _Compilation()
    try:
        with event.install_listener("numba:compile", shown):
            warm_up()
    finally:
        shown.end()


class _Compilation(event.Listener):
    """Count the kernels that are compiled; Numba reports only those that its cache lacks."""

    def __init__(self) -> None:
        self._ready: set[str] = set()
        self._progress = Progress(lambda done, of: f"{PURPOSE}: {done} of {of}")
        self._announced = False

    def on_start(self, _: Any) -> None:
        """Announce the first kernel: with the bar, or as a line where no terminal can show it."""
        if self._announced:
            return
        self._announced = True
        self._progress.show(0, len(KERNELS))
        if not sys.stderr.isatty():
            print(f"{PURPOSE} (about a minute)", file=sys.stderr, flush=True)

    def on_end(self, compiled: Any) -> None:
        """Count a kernel that is ready."""
        function = compiled.data["dispatcher"].py_func
        if function.__module__.partition(".")[0] == "slipd":  # and not a function of NumPy that a kernel calls
            self._ready.add(f"{function.__module__}.{function.__qualname__}")
        self._progress.show(len(self._ready), len(KERNELS))

    def end(self) -> None:
        """Erase the line."""
        self._progress.erase()


if __name__ == "__main__":
    compile_kernels()
