"""The program ``slipctl``, also as ``python -m slipd_client``."""

from __future__ import annotations

import importlib
import sys


def run_program(module: str) -> int:
    """Import a program and run it; Ctrl-C meanwhile ends it without a message.

    Args:
        module: Has a function ``main`` that returns the exit code.

    Returns:
        The exit code; 130 after Ctrl-C.
    """
    try:
        code: int = importlib.import_module(module).main()
    except KeyboardInterrupt:
        return 130
    return code


def main() -> int:
    """Run one command; return its exit code."""
    return run_program("slipd_client.slipctl")


if __name__ == "__main__":
    sys.exit(main())
