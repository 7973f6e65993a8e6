"""What the first call of the friction limit costs in a fresh process: import, cached kernels, and compiling them."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from bench.tables import Table

RUNS, QUICK_RUNS = 5, 1
WANTED_S = 1.0
"""The first call after import, with a warm cache."""

LONGEST_S = 300.0
"""A cold compile takes a good part of a minute on a slow machine."""

IMPORT = "import slipd.fusion"
CALLS = """
x, y, loads = np.array((0.0, 0.01, 0.0)), np.array((0.0, 0.0, 0.01)), np.array((1.0, 2.0, 3.0))
slipd.fusion.torque_limit(x, y, loads, 0.5, np.array((0.1, 0.0)), np.array((0.005, 0.005)))
slipd.fusion.utilisation(x, y, loads, 0.5, np.array((0.1, 0.0)), 0.001, np.array((0.005, 0.005)))
"""
WARM_UP_IMPORT = "from slipd.engine.warm_up import warm_up"
WARM_UP = "warm_up()"
PROGRAM = """
import json, time
start = time.perf_counter()
import numpy as np
numpy_s = time.perf_counter() - start
start = time.perf_counter()
{imported}
import_s = time.perf_counter() - start
start = time.perf_counter()
{called}
print(json.dumps((numpy_s, import_s, time.perf_counter() - start)))
"""


def run(*, quick: bool = False) -> Table:
    """Measure in new processes; ``quick``: once, with the cache as it is."""
    runs = QUICK_RUNS if quick else RUNS
    table = Table("Friction limit: the first call, s", ("what", "processes", "median", "least", "most"))
    if not quick:  # fill the cache
        _fresh(IMPORT, CALLS)
        _fresh(WARM_UP_IMPORT, WARM_UP)
    warm = [_fresh(IMPORT, CALLS) for _ in range(runs)]
    everything = [_fresh(WARM_UP_IMPORT, WARM_UP) for _ in range(runs)]
    _row(table, "import NumPy", [took[0] for took in warm])
    _row(table, "import slipd.fusion, NumPy imported before", [took[1] for took in warm])
    calls_s = [took[2] for took in warm]
    _row(table, "first torque_limit and utilisation, cache warm", calls_s)
    _row(table, "warm_up(): every kernel, cache warm", [took[2] for took in everything])
    if not quick:
        with tempfile.TemporaryDirectory(prefix="slipd-bench-") as empty:
            cold_s, rest_s = (_fresh(*what, Path(empty))[2] for what in ((IMPORT, CALLS), (WARM_UP_IMPORT, WARM_UP)))
        _row(table, "first torque_limit and utilisation, nothing compiled", [cold_s])
        _row(table, "warm_up() after that: the other kernels compiled", [rest_s])
    reached = "reached" if statistics.median(calls_s) <= WANTED_S else "NOT REACHED"
    table.notes.append(f"Wanted: the first calls from a warm cache within {WANTED_S:g} s: {reached}.")
    return table


def _fresh(imported: str, called: str, cache: Path | None = None) -> list[float]:
    """Seconds for NumPy's import, the import and the calls, in a new interpreter."""
    environment = os.environ | ({"NUMBA_CACHE_DIR": str(cache)} if cache else {})
    program = PROGRAM.format(imported=imported, called=called)
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True, timeout=LONGEST_S
    )
    return json.loads(done.stdout)


def _row(table: Table, what: str, took_s: list[float]) -> None:
    shown = (f"{value:.3f}" for value in (statistics.median(took_s), min(took_s), max(took_s)))
    table.rows.append((what, len(took_s), *shown))
