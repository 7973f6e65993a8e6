"""Measure slipd on the real contacts of this repository: objects that a robot pushes over a board.

    PYTHONPATH=tests/support:benchmarks python -m realdata [--folder FOLDER] [RUN …]

Every run of ``tests/data/pushes/runs`` is imported as by ``slipd import pushes``, replayed through the engine, and
compared with the motion capture: onsets, share of sliding reported, reports at rest, μ, and λ at the onset. Beside it
stands an oracle that knows the motion and takes the best limit on the load of that run. FOLDER: runs of your own, with
a ``runs.csv`` of the columns run, file (a bag or its compact form), clear_begin_s and clear_end_s.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from realdata.report import lines
from realdata.runs import RUNS, measure

from slipd.errors import SlipdError


def main(argv: list[str] | None = None) -> int:
    """Measure the runs and print the tables; return 1 if a run cannot be measured, else 0."""
    parser = argparse.ArgumentParser(prog="python -m realdata", description="Measure slipd on real contacts.")
    parser.add_argument("runs", nargs="*", metavar="RUN", help="names of runs (default: all)")
    parser.add_argument("--folder", type=Path, default=RUNS, help="folder with runs.csv (default: the repository's)")
    options = parser.parse_args(argv)
    try:
        print("\n".join(lines(measure(options.folder, options.runs))))
    except (OSError, SlipdError) as error:
        print(f"realdata: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
