"""Where the project's own files are, for tests and programs that read them."""

import os
from pathlib import Path

ROOT = Path(__file__).parents[2]
CONFIG, DOCS, DAEMON = ROOT / "config", ROOT / "docs", ROOT / "daemon" / "slipd"
MEASURED = ROOT / "build" / "measured"
DATA = ROOT / "tests" / "data"
TRIAL = DATA / "grips" / "2022-02-22-08-10-01"
"""A real gripper trial."""

MODULES = os.pathsep.join(str(ROOT / name) for name in ("tests/support", "benchmarks"))
"""``PYTHONPATH`` of a program of tests or benchmarks that runs in a process of its own."""
