"""Run the numeric tests with the instruction sets of other processors, each setting in a process of its own.

    make portable    (about 10 minutes; writes build/measured/portability.md)
    PYTHONPATH=tests/support:benchmarks python -m portable [--quick | --aarch64 FOLDER] [--report FILE]
        [PYTEST ARGUMENT…]

The result is the number of tests that pass, fail and are skipped in each setting. ``--quick`` runs the failure atlas,
the load rules and the contact tests as on the oldest processor alone. ``--aarch64`` also runs the tests on an emulated
aarch64 machine, which it makes once in FOLDER; that takes about an hour. Each setting compiles the kernels into a cache
of its own. The table is printed, and ``--report`` also writes it as Markdown.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from bench.commit import measured_on
from bench.tables import Table
from portable import aarch64
from portable.settings import settings
from project import ROOT

ROOMS = ("tests/unit/fusion", "tests/unit/devices", "tests/unit/signals", "benchmarks/chart")
QUICK = tuple(f"tests/unit/fusion/test_{name}.py" for name in ("failure_atlas", "loads", "contact"))
_COUNTS = re.compile(r"(\d+) (passed|failed|error|skipped)")


def main() -> int:
    """Run the tests; return 1 where any failed, else 0."""
    parser = argparse.ArgumentParser(
        prog="python -m portable", description="Run the numeric tests with the instruction sets of other processors."
    )
    parser.add_argument("--quick", action="store_true", help="a share of the tests, as on the oldest processor only")
    parser.add_argument(
        "--aarch64", type=Path, metavar="FOLDER", help="also run them on an aarch64 machine that is emulated in FOLDER"
    )
    parser.add_argument("--report", type=Path, metavar="FILE", help="also write the table as Markdown")
    options, arguments = parser.parse_known_args()
    names = QUICK if options.quick else ROOMS
    table = Table("Numeric tests by processor", ("acts as", "passed", "failed", "skipped", "time"))
    table.notes.append(f"tests: {', '.join(names)}")
    failed = False
    with tempfile.TemporaryDirectory(prefix="slipd-portable-") as cache:
        for machine in _machines(options.aarch64, quick=options.quick):
            code, row = _run(machine, Path(cache) / machine.name, [*(str(ROOT / name) for name in names), *arguments])
            failed = failed or code != 0
            table.rows.append(row)
            table.notes.append(f"{machine.name}: {machine.says}")
    print(table.text(), flush=True)
    if options.report:
        options.report.write_text(f"# Portability\n\n{measured_on()}.\n{table.markdown()}\n", encoding="utf-8")
    return int(failed)


@dataclass(frozen=True, slots=True)
class _Machine:
    """What runs the tests: a Python, its environment, and what the report says of it."""

    name: str
    python: list[str]
    env: dict[str, str]
    says: str


def _machines(aarch64_folder: Path | None, *, quick: bool) -> list[_Machine]:
    machines = [_Machine(found.name, [sys.executable], found.env, str(found)) for found in settings()]
    if quick:
        return machines[:1]
    if aarch64_folder is not None:
        python, env = aarch64.prepare(aarch64_folder.resolve())
        machines.append(
            _Machine(
                "aarch64",
                python,
                env,
                "qemu-user, Debian's Python, released wheels; without the tests that start processes",
            )
        )
    return machines


def _run(machine: _Machine, cache: Path, arguments: list[str]) -> tuple[int, tuple[str, ...]]:
    """Run pytest on a machine; return its exit code and a row of the report."""
    print(f"== {machine.name}: {machine.says}", flush=True)
    begun_s = time.monotonic()
    emulated = ("-o", "timeout=3600", "-m", "not process") if machine.name == "aarch64" else ()
    done = subprocess.run(
        [*machine.python, "-m", "pytest", "-q", "-p", "no:cacheprovider", *emulated, *arguments],
        env=os.environ | machine.env | {"NUMBA_CACHE_DIR": str(cache)},
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    last = done.stdout.strip().splitlines()[-1:]
    print(done.stdout if done.returncode else "".join(last), flush=True)
    counts = {word: int(count) for count, word in _COUNTS.findall("".join(last))}
    bad = counts.get("failed", 0) + counts.get("error", 0)
    if done.returncode and not bad:
        bad = 1
    passed, skipped = counts.get("passed", 0), counts.get("skipped", 0)
    took = f"{time.monotonic() - begun_s:.0f} s"
    return done.returncode, (machine.name, str(passed), str(bad), str(skipped), took)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except aarch64.UnavailableError as error:
        sys.exit(f"portable: {error}")
