"""Run the daemon for long on this machine: unplugging, floods, long loads and faults.

    make soak    (about two hours with the simulation; writes build/measured/soak.md)
    PYTHONPATH=tests/support:benchmarks python -m soak [--quick] [--only unplug|flood|backlog|endure] [--minutes M]
        [--report FILE]

The daemon is the real one, with real pseudo-terminals, sockets and processes. Measured are lost readings and messages,
recovery times, memory, and delays. Times hold for this machine and its present load. The report is printed, and
``--report`` also writes it as Markdown.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from bench.child import BenchError
from bench.commit import measured_on
from bench.tables import Table
from soak import backlog, endure, flood, unplug

PARTS = ("unplug", "flood", "backlog", "endure")
ENDURANCE = 3.0
"""The virtual gripper with faults runs for so many times the minutes of the other long parts."""


def main() -> int:
    """Measure and print; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m soak", description="Run the daemon for long on this machine.")
    parser.add_argument(
        "--only", action="append", choices=PARTS, help="run this part only; may be repeated (default: all)"
    )
    parser.add_argument(
        "--minutes",
        type=float,
        default=10.0,
        metavar="M",
        help=f"of the backlog (default 10), and {ENDURANCE:g} times as many of the faults",
    )
    parser.add_argument(
        "--quick", action="store_true", help="a short run, at most a minute, to check the program itself"
    )
    parser.add_argument("--report", type=Path, metavar="FILE", help="also write the report as Markdown")
    options = parser.parse_args()
    header = measured_on()
    print(f"slipd soak: {header}", flush=True)
    pages = [f"# Long runs\n\n{header}."]
    try:
        for table in _sections(options.only or PARTS, 60.0 * options.minutes, quick=options.quick):
            print(table.text(), flush=True)
            pages.append(table.markdown())
            if options.report:  # what was measured stays, whatever comes
                options.report.write_text("\n".join(pages) + "\n", encoding="utf-8")
    except BenchError as error:
        print(f"soak: {error}", file=sys.stderr)
        return 1
    return 0


def _sections(parts: tuple[str, ...], long_s: float, *, quick: bool) -> Iterator[Table]:
    with tempfile.TemporaryDirectory(prefix="slipd-soak-") as name:
        folder = Path(name)
        os.environ["SLIPD_RUNTIME_DIR"] = str(folder / "run")
        if "unplug" in parts:
            yield from unplug.run(folder, quick=quick)
        if "flood" in parts:
            yield flood.run(folder, quick=quick)
        if "backlog" in parts:
            yield from backlog.run(folder, long_s, quick=quick)
        if "endure" in parts:
            yield from endure.run(folder, ENDURANCE * long_s, quick=quick)


if __name__ == "__main__":
    sys.exit(main())
