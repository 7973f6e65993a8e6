"""Run slipd, and send SIGINT to it while Numba takes a kernel from its cache or stores one there.

python -m interrupted_load load|store COMMAND...      slipd COMMAND..., with SIGINT at the first kernel
"""

from __future__ import annotations

import os
import signal
import sys
from typing import Any

from numba.core.codegen import CPUCodeLibrary

CALLBACKS = {"load": "_object_getbuffer_hook", "store": "_object_compiled_hook"}


def interrupt_at(name: str) -> None:
    """Send SIGINT when LLVM calls back for the first time."""
    callback = getattr(CPUCodeLibrary, name)
    first = iter([signal.SIGINT])

    def interrupted(*arguments: Any) -> Any:
        for number in first:
            os.kill(os.getpid(), number)
        return callback(*arguments)

    setattr(CPUCodeLibrary, name, interrupted)


if __name__ == "__main__":
    interrupt_at(CALLBACKS[sys.argv[1]])
    sys.argv = ["slipd", *sys.argv[2:]]

    from slipd.cli import main

    sys.exit(main())
