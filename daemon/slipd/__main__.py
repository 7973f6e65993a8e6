"""The program ``slipd``, also as ``python -m slipd``."""

from __future__ import annotations

import sys

from slipd_client.__main__ import run_program


def main() -> int:
    """Run one command; return its exit code."""
    return run_program("slipd.cli")


if __name__ == "__main__":
    sys.exit(main())
