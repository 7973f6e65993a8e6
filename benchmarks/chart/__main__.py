"""Compare every method of the friction limit on the same contacts.

    make chart    (about 10 minutes)
    PYTHONPATH=tests/support:benchmarks python -m chart [--quick] [--only PART] [--scenes N] [--into FOLDER]

Measured are processor time, error against a 25-digit reference, and failures of each method. Each part writes a page
and its pictures into FOLDER (default: build/measured): ``speed_accuracy`` and ``failure_atlas``, .md and .png.
"""

from __future__ import annotations

import argparse
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
from bench.commit import measured_on
from project import MEASURED

SCENES, QUICK_SCENES = 1500, 15
SOLVER_SCENES = 200
"""On which the cone solver is timed without its set-up."""

PARTS = ("speed", "atlas")
PACKAGES = ("numpy", "scipy", "numba", "clarabel")


def main() -> int:
    """Run the parts and write their pages; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m chart", description="Compare every method of the friction limit.")
    parser.add_argument("--quick", action="store_true", help="few scenes, to check the program itself")
    parser.add_argument("--scenes", type=int, metavar="N", help=f"number of scenes (default {SCENES})")
    parser.add_argument(
        "--only", choices=PARTS, action="append", help="write this report only; may be repeated (default: all)"
    )
    parser.add_argument(
        "--into", type=Path, default=MEASURED, metavar="FOLDER", help="folder of the reports (default: build/measured)"
    )
    options = parser.parse_args()
    if missing := [name for name in ("matplotlib", "clarabel") if not _is_installed(name)]:
        print(f"chart: needs {' and '.join(missing)}: pip install -e '.[chart,dev]'", file=sys.stderr)
        return 1
    parts = options.only or PARTS
    header = measured_on(*(f"{name} {version(name)}" for name in PACKAGES))
    _say(f"slipd chart: {header}")
    if "speed" in parts:
        count = options.scenes or (QUICK_SCENES if options.quick else SCENES)
        _write_speed(options.into, header, count, quick=options.quick)
    if "atlas" in parts:
        _write_atlas(options.into, header, quick=options.quick)
    return 0


def _write_speed(folder: Path, header: str, count: int, *, quick: bool) -> None:
    from chart import model_error, picture, pushes, scaling
    from chart.rivals import cone
    from chart.scores import questions, scores
    from chart.speed_accuracy import Report

    _say(f"right answers of {count} contacts, to 25 digits")
    asked = questions(count)
    _say("every method on each of them")
    report = Report(asked, scores(asked))
    solver_s = float(np.median([cone.solver_seconds(question.scene) for question in asked[:SOLVER_SCENES]]))
    _say("cost against taxels")
    cost = scaling.run(quick)
    _say("model error")
    model = model_error.run(quick)
    pages = [f"# Speed against accuracy\n\n{header}.", report.text(solver_s)]
    for table in (*report.tables(cost), *model.tables(), *pushes.tables()):
        _say(table.text())
        pages.append(table.markdown())
    (folder / "speed_accuracy.md").write_text("\n\n".join(pages) + "\n", encoding="utf-8")
    picture.save(folder / "speed_accuracy.png", report.scores, solver_s, cost, model)


def _write_atlas(folder: Path, header: str, *, quick: bool) -> None:
    from chart import atlas

    _say("failure atlas")
    page = f"# Failure atlas\n\n{header}.\n\n{atlas.run(quick)}"
    (folder / "failure_atlas.md").write_text(page.rstrip() + "\n", encoding="utf-8")


def _is_installed(name: str) -> bool:
    from importlib.util import find_spec

    return find_spec(name) is not None


def _say(text: str) -> None:
    print(text, flush=True)


if __name__ == "__main__":
    sys.exit(main())
