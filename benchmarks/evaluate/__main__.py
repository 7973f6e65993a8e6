"""How good are the warnings? Simulated grasps through sensors and engine, scored against what really happened.

    make evaluate                                                          (the report, from the evaluation's seeds)
    PYTHONPATH=tests/support:benchmarks .venv/bin/python -m evaluate --quick --families ramp,hold --seeds 5

``--quick`` prints one compact table, from development seeds, in less than a minute: for everyone who tunes slipd. A
row is a family at one μ factor (μ of the config over the true one; "no" where the config has none). Its options:

- ``--families A,B``: names, or parts of names; default: all.
- ``--seeds N``: grasps of each family (default 3 of families that are named, else 1); ``--first K`` begins at another
  development seed.
- ``--factors 0.8,1,no``: default 0.8, 1.0, 1.2 and no μ.
- ``--extra TEXT``, ``--finger TEXT``: more lines for the config, such as ``--finger 'mu_spread = 0.0'``.
- ``--runs``: also one line for every run with a missed, silent, early or false report, to look at it.
- ``--world second``: in the world of other physics, see `second_world`.
- ``--detection``: instead of this table, how soon sliding is reported, see `evaluate.detection`.
- ``--workers N``: processes (default 1).

Without ``--quick`` it writes the report and its pictures; ``--seeds`` is then their number of grasps of each family,
``--methods`` and ``--loops`` those of the comparison of methods and with the reflex, ``--minutes`` a limit on the time
of the first, and ``--into`` the folder.

Scores are cached by a hash of the code: a second call on the same code is free. Columns, all defined in
`evaluate.score`: *slips* (of them long), *warned*, *lead* p5 in ms, *latency* of slipping p50/p95 in ms, *missed*,
*silent*, *1 mm* (reported within 1 mm of sliding), *closing* and *early* (runs with a false slipping while the grip
closes, and later before any slip), false *slipping* and *warnings* (number), *sliding* reported/stable, *changes* on
the way p95 and a minute in holds, *λ error* p50/p95, *grip* too small.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import defaultdict
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from bench.commit import measured_on
from bench.tables import Table
from evaluate.campaign import run_campaign
from evaluate.detection import detection
from evaluate.families import DEVELOPMENT, EVALUATION, FAMILIES
from evaluate.running import Result, Task, Variant, run_all
from evaluate.summary import Summary, summarise
from evaluate.worlds import WORLDS
from project import MEASURED

QUICK_SEEDS, QUICK_SEEDS_OF_ALL = 3, 1
REPORT_SEEDS, METHOD_SEEDS, LOOP_SEEDS, REPORT_WORKERS = 12, 4, 10, 2
EXAMPLE_SEED = 1
"""Of the picture of single grasps: a development seed."""

QUICK_FACTORS = "0.8,1,1.2,no"

HEAD = ("family", "μ", "slips", "warned", "lead", "latency", "missed", "silent", "1 mm", "closing", "early", "slipping",
        "warnings", "sliding", "changes", "λ error", "grip")  # fmt: skip


def main(argv: Sequence[str] | None = None) -> int:
    """Run and print; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m evaluate", description="Score slipd's warnings.")
    parser.add_argument("--quick", action="store_true", help="one compact table from development seeds")
    parser.add_argument("--detection", action="store_true", help="one table of how soon sliding is reported, likewise")
    parser.add_argument("--world", choices=WORLDS, default="first", help="which simulated world (default: first)")
    parser.add_argument("--families", default="", metavar="A,B", help="names, or parts of them (default: all)")
    parser.add_argument("--seeds", type=count, metavar="N", help="grasps of each family")
    parser.add_argument("--first", type=int, default=0, metavar="K", help="first seed")
    parser.add_argument(
        "--factors", type=factors, default=QUICK_FACTORS, metavar="F,F", help=f"default {QUICK_FACTORS}"
    )
    parser.add_argument("--extra", default="", metavar="TEXT", help="more tables of the config")
    parser.add_argument("--finger", default="", metavar="TEXT", help="more lines of [finger.left]")
    parser.add_argument("--runs", action="store_true", help="also every run with a fault")
    parser.add_argument("--methods", type=count, default=METHOD_SEEDS, metavar="N", help="grasps for methods (report)")
    parser.add_argument("--loops", type=count, default=LOOP_SEEDS, metavar="N", help="grasps with the reflex (report)")
    parser.add_argument("--minutes", type=float, default=math.inf, metavar="M", help="no new grasps after (report)")
    parser.add_argument("--into", type=Path, default=MEASURED, metavar="FOLDER", help="folder of the report")
    parser.add_argument("--workers", type=count, metavar="N", help="processes (default 1; report: 2)")
    options = parser.parse_args(argv)
    if not (options.quick or options.detection):
        return report(options)
    families = chosen(options.families)
    if not families:
        print(f"no family is named like {options.families!r}; there are: {', '.join(FAMILIES)}", file=sys.stderr)
        return 2
    variants = tuple(Variant(factor, finger_lines=options.finger, extra=options.extra) for factor in options.factors)
    seeds = options.seeds or (QUICK_SEEDS if options.families else QUICK_SEEDS_OF_ALL)
    return quick(families, range(options.first, options.first + seeds), variants, options)


def report(options: argparse.Namespace) -> int:
    """Run everything and write the report and its pictures."""
    if missing := [name for name in ("matplotlib", "clarabel") if find_spec(name) is None]:
        print(f"evaluate: needs {' and '.join(missing)}: pip install -e '.[chart,dev]'", file=sys.stderr)
        return 1
    from evaluate import closed_loop, examples_picture, pictures
    from evaluate import report as page
    from evaluate.methods import compare, costs

    options.into.mkdir(parents=True, exist_ok=True)
    header, workers = measured_on(), options.workers or REPORT_WORKERS
    begun = time.monotonic()

    def told(done: int, total: int) -> bool:
        spent_s = time.monotonic() - begun
        print(f"{done} of {total} grasps of each family, {spent_s:.0f} s", flush=True)
        return spent_s * (done + 1) / done < 60.0 * options.minutes

    campaign = run_campaign(options.seeds or REPORT_SEEDS, workers, told)
    print("methods on the same messages", flush=True)
    first = EVALUATION.start
    found, spent = compare(range(first, first + options.methods), workers), costs(DEVELOPMENT.start)
    print("the reflex in the loop", flush=True)
    loop = closed_loop.run(range(first, first + options.loops), workers)
    pictures.save_figures(options.into / "warning_quality.png", campaign)
    pictures.save_methods(options.into / "warning_quality_methods.png", found, spent)
    examples_picture.save(options.into / "warning_quality_grasps.png", EXAMPLE_SEED)
    page.write(options.into / "warning_quality.md", page.page(header, campaign, found, options.methods, loop))
    return 0


def count(text: str) -> int:
    """Return the number in a text, 1 or more."""
    if not text.isdecimal() or not int(text):
        raise argparse.ArgumentTypeError(f"must be a whole number from 1 on, got {text!r}")
    return int(text)


def factors(text: str) -> list[float | None]:
    """Return the μ factors of a text; None for "no" μ."""
    return [None if part == "no" else float(part) for part in text.split(",")]


def chosen(text: str) -> list[str]:
    """Return the families of which a part of the name is given; all of them without one."""
    parts = [part.strip().replace("_", " ") for part in text.split(",") if part.strip()]
    exact = [name for name in FAMILIES if name in parts]
    parts = [part for part in parts if part not in exact]
    return [name for name in FAMILIES if not text or name in exact or any(part in name for part in parts)]


def quick(families: list[str], seeds: range, variants: tuple[Variant, ...], options: argparse.Namespace) -> int:
    """Print the compact table."""
    if seeds.stop > DEVELOPMENT.stop:
        print(f"seeds must be below {DEVELOPMENT.stop}: the others are the report's", file=sys.stderr)
        return 2
    begun = time.monotonic()
    tasks = [Task(family, seed, variants, options.world) for family in families for seed in seeds]
    results = list(run_all(tasks, options.workers or 1))
    if options.detection:
        print(detection(results, families, f"detection, {options.world} world, μ factors {options.factors}").text())
    else:
        print(table(results, families, variants).text())
    if options.runs:
        print("\n".join(faults(results)))
    print(f"{len(results)} runs in {time.monotonic() - begun:.0f} s")
    return 0


def table(results: Sequence[Result], families: Sequence[str], variants: Sequence[Variant]) -> Table:
    """Return a row for each family and variant, and for all families together."""
    groups: dict[tuple[str, Variant], list[Result]] = defaultdict(list)
    for result in results:
        groups[result.family, result.variant].append(result)
        groups["all", result.variant].append(result)
    found = Table("quality of the warnings", HEAD)
    for family in (*families, "all"):
        for variant in variants:
            scores = [result.score for result in groups[family, variant]]
            found.rows.append(row(family, _factor(variant), summarise(scores)))
    return found


def row(family: str, factor: str, s: Summary) -> list[str]:
    """Return a row of the compact table."""
    return [
        family, factor, f"{s.slips}({s.long})", _percent(s.warned), _whole(s.lead_p5_ms),
        f"{_whole(s.latency_p50_ms)}/{_whole(s.latency_p95_ms)}", _percent(s.missed), _percent(s.silent),
        _percent(s.within_1mm), _percent(s.closing), _percent(s.early), str(s.false_slipping), str(s.false_warnings),
        f"{_percent(s.reported)}/{_percent(s.stable)}", f"{_whole(s.changes_p95)} {_whole(s.changes_per_min, 1)}",
        f"{_whole(100.0 * s.used_p50, 1)}/{_whole(100.0 * s.used_p95, 1)}", _percent(s.grip_short),
    ]  # fmt: skip


def faults(results: Sequence[Result]) -> list[str]:
    """Return a line for each run in which something is wrong."""
    lines = []
    for one in sorted(results, key=lambda one: (one.family, one.seed)):
        score = one.score
        wrong = {
            "missed": sum(slip.missed for slip in score.episodes),
            "silent": sum(slip.silent for slip in score.episodes),
            "not warned": sum(slip.first and not slip.warned for slip in score.episodes),
            "closing": int(score.closing),
            "early": int(score.early),
            "false slipping": score.false_slipping,
            "false warnings": score.false_warnings,
        }
        if any(wrong.values()):
            told = ", ".join(f"{count} {name}" for name, count in wrong.items() if count)
            lines.append(f"{one.family}, seed {one.seed}, μ factor {_factor(one.variant)}: {told}")
    return lines


def _factor(variant: Variant) -> str:
    return "no" if variant.factor is None else f"{variant.factor:.1f}"


def _percent(value: float) -> str:
    return "" if value != value else f"{100.0 * value:.0f}%"


def _whole(value: float, digits: int = 0) -> str:
    return "" if value != value else f"{value:.{digits}f}"


if __name__ == "__main__":
    sys.exit(main())
