"""The emulated devices beside implementations that others wrote.

    make peers    (about a minute; writes docs/measured/peers.md)
    PYTHONPATH=tests/support:benchmarks python -m peers [--report FILE]

An emulator that a maker's driver accepts sends what the device sends, and `tests/unit/tools/sim/test_every_emulator.py`
checks that slipd reads what the emulators send. So a misreading shows, unless both sides of this chain share it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from bench.commit import measured_on
from peers import bota_peer, netft_peer, optoforce_peer, robotiq_peer, xela_peer
from peers.comparison import Comparison
from peers.report import render

COMPARISONS: tuple[Callable[[Path], Comparison], ...] = (
    bota_peer.compare,
    netft_peer.compare_counts,
    netft_peer.compare_units,
    optoforce_peer.compare,
    robotiq_peer.compare_driver,
    robotiq_peer.compare_registers,
    xela_peer.compare,
)

BY_HAND = "\n## Mutants"
"""From here on the page is written by hand, and kept."""


def main() -> int:
    """Compare and print; return 1 if a comparison found a difference."""
    parser = argparse.ArgumentParser(prog="python -m peers", description="Compare with independent implementations.")
    parser.add_argument("--report", type=Path, metavar="FILE", help="also write the report as Markdown")
    options = parser.parse_args()
    found = []
    with tempfile.TemporaryDirectory(prefix="slipd-peers-") as folder:
        for compare in COMPARISONS:
            comparison = compare(Path(folder))
            found.append(comparison)
            print(f"{comparison.device} beside {comparison.peer}: {comparison.direction}", flush=True)
            for verdict in ("agrees", "differs", "open"):
                for what in getattr(comparison, verdict):
                    print(f"  {verdict:8} {what}", flush=True)
    if options.report:
        options.report.parent.mkdir(exist_ok=True)
        kept = options.report.read_text(encoding="utf-8").partition(BY_HAND)[1:] if options.report.exists() else ()
        options.report.write_text("".join((render(found, measured_on()), *kept)), encoding="utf-8")
    return int(any(comparison.differs for comparison in found))


if __name__ == "__main__":
    sys.exit(main())
