"""Leave each source of evidence and each rule of slip out in turn, and print a table of what is left.

    PYTHONPATH=tests/support:benchmarks python -m fit.ablation [--folder FOLDER] [--seeds N …] [--only WORD]

Grasps and pushes run through the engine once, and are kept in the folder; then a rule takes seconds. A row reads: slips
reported by 1, 2 and 5 mm of sliding · slips of 10 mm and more that are never reported · grasps falsely reported; and
of the loads that the tests draw, how many are falsely reported.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from itertools import chain
from pathlib import Path

from evaluate.families import FAMILIES
from evaluate.running import cache_folder
from fit.drawn import drawn
from fit.record import Grasp, grasps, pushes
from fit.replay import LoadRules, beside_load, joined
from fit.rules import IMAGE, LOAD, replaced
from fit.score import CREEPS, RATIO, Score, Spans, score

SEEDS = (60_000, 60_003)
"""No rule was tuned on these seeds, of either world; of one, the contact moves with an object that does not slip."""
WORLDS = ("first", "second")
DRAWN = "drawn"
Kept = Mapping[str, list[tuple[str, Grasp]]]
"""Grasps by set, each with its world; "" where it is of none."""


def main() -> None:
    """Print a row for each source and rule: what is reported without it."""
    parser = argparse.ArgumentParser(prog="python -m fit.ablation", description="Leave each rule of slip out in turn.")
    parser.add_argument("--folder", type=Path, default=cache_folder().with_name("fit"), help="folder of kept grasps")
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS, metavar="N", help="seeds of each family")
    parser.add_argument("--only", default="", metavar="WORD", help="only rules with this in their name")
    options = parser.parse_args()
    kept = sets(options.folder, options.seeds)
    rules = LoadRules({constant for values in LOAD.values() for constant in values})
    load, beside = _by_load(kept, rules, {}), _beside_load(kept)
    print("| without |", " | ".join(kept), "|\n| --- |", "--- | " * len(kept))
    _print("of", kept, [[]] * len(load), totals=True)
    _print("(all rules)", kept, _both(load, beside))
    for name, values in LOAD.items():
        if options.only in name:
            _print(name, kept, _both(_by_load(kept, rules, values), beside))
    for name, replacing in IMAGE.items():
        if options.only in name:
            with replaced(replacing):
                _print(name, kept, _both(load, _beside_load(kept)))


def sets(folder: Path, seeds: list[int]) -> Kept:
    """Return the grasps of each world, those of both that creep, the pushes, and the loads that the tests draw."""
    found: dict[str, list[tuple[str, Grasp]]] = {name: [] for name in (*WORLDS, "creep", "pushes", DRAWN)}
    for world in WORLDS:
        for grasp in grasps(FAMILIES, seeds, folder, world):
            if grasp.family in CREEPS:  # scored whatever the friction is
                found["creep"].append((world, replace(grasp, ratio=RATIO[0])))
            else:
                found[world].append((world, grasp))
    found["pushes"] = [("", grasp) for grasp in pushes(folder)]
    found[DRAWN] = [("", grasp) for grasp in drawn()]
    return found


def _by_load(kept: Kept, rules: LoadRules, values: Mapping[str, float]) -> list[Spans]:
    """Return when the load of each grasp shows slip, with other values of some constants."""
    return [rules.spans(grasp, values) for _, grasp in chain(*kept.values())]


def _beside_load(kept: Kept) -> list[Spans]:
    """Return when other evidence shows slip of each grasp."""
    return [beside_load(grasp, world) if world else [] for world, grasp in chain(*kept.values())]


def _both(load: list[Spans], beside: list[Spans]) -> list[Spans]:
    return [joined([*one, *other]) for one, other in zip(load, beside, strict=True)]


def _print(name: str, kept: Kept, reported: list[Spans], *, totals: bool = False) -> None:
    """Print a row: the scores of each set of grasps, or how many there are to be reported."""
    cells, spans = [], iter(reported)
    for group, some in kept.items():
        total = sum((score(grasp, next(spans)) for _, grasp in some), Score())
        found = (total.reached, total.far, total.grasps) if totals else (total.reported, total.never, total.false)
        cells.append(f"{found[2]}" if group == DRAWN else f"{' '.join(map(str, found[0]))} · {found[1]} · {found[2]}")
    print(f"| {name} |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
