"""Run the numeric tests as on other processors: each setting in a process of its own.

    PYTHONPATH=tests python -m portable [--quick] [--report FILE] [PYTEST ARGUMENT…]

``--quick`` runs the failure atlas and the load rules on the oldest processor alone. The kernels of each setting are
compiled into a cache of its own.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from bench.commit import measured_on
from bench.tables import Table
from portable.settings import Setting, settings

TESTS = Path(__file__).resolve().parents[1]
ROOMS = ("fusion", "devices", "signals", "chart")
QUICK = ("fusion/test_failure_atlas.py", "fusion/test_loads.py", "fusion/test_contact.py")
_COUNTS = re.compile(r"(\d+) (passed|failed|errors?|skipped)")


def main() -> int:
    """Run the tests; return 1 where any failed, else 0."""
    parser = argparse.ArgumentParser(prog="python -m portable", description="Numeric tests as on other processors.")
    parser.add_argument("--quick", action="store_true", help="a share of the tests, as on the oldest processor")
    parser.add_argument("--report", type=Path, metavar="FILE", help="write the result as markdown")
    options, arguments = parser.parse_known_args()
    tests = [str(TESTS / name) for name in (QUICK if options.quick else ROOMS)]
    table = Table("Numeric tests by processor", ("acts as", "passed", "failed", "time"))
    failed = False
    with tempfile.TemporaryDirectory(prefix="slipd-portable-") as cache:
        for setting in settings()[:1] if options.quick else settings():
            code, row = _run(setting, Path(cache) / setting.name.replace(" ", "-"), [*tests, *arguments])
            failed = failed or code != 0
            table.rows.append(row)
            table.notes.append(f"{setting.name}: {setting}")
    print(table.text(), flush=True)
    if options.report:
        options.report.write_text(f"# Portability\n\n{measured_on()}.\n{table.markdown()}\n", encoding="utf-8")
    return int(failed)


def _run(setting: Setting, cache: Path, arguments: list[str]) -> tuple[int, tuple[str, ...]]:
    """Run pytest under a setting; return its exit code and a row of the report."""
    print(f"== {setting.name}: {setting}", flush=True)
    begun_s = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments],
        env=os.environ | setting.env | {"NUMBA_CACHE_DIR": str(cache)},
        cwd=TESTS.parent,
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    last = done.stdout.strip().splitlines()[-1:]
    print(done.stdout if done.returncode else "".join(last), flush=True)
    counts = {word: count for count, word in _COUNTS.findall("".join(last))}
    bad = int(counts.get("failed", 0)) + int(counts.get("error", counts.get("errors", 0)))
    if done.returncode and not bad:
        bad = 1
    took = f"{time.monotonic() - begun_s:.0f} s"
    return done.returncode, (setting.name, counts.get("passed", "0"), str(bad), took)


if __name__ == "__main__":
    sys.exit(main())
