"""Fit a posterior of slip on one half of simulated grasps, and report it on the other half and on other physics.

    PYTHONPATH=tests/support:benchmarks python -m fit [--seeds N] [--second N] [--folder FOLDER] [--workers N]
        [--ablation]

Grasps are simulated once and kept in the folder; then a run takes seconds. Weights are fitted on the first half of the
seeds of the product's simulator. Beside them stands the detector of the daemon that recorded the grasps: empty the
folder after a change of the daemon. ``--ablation`` also fits without each source: the change of the loss on either set
of grasps that nothing was fitted on; below 0, the source does harm there.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from evaluate.families import FAMILIES
from evaluate.running import cache_folder
from fit.fitting import bags, fit, loss_of, spans
from fit.posterior import JUMP, SOURCES, Looks, looks
from fit.record import Grasp, grasps
from fit.score import CREEPS, Score, score, today

FIRST, SEEDS, SECOND = 50_000, 16, 7
"""First seed of the product's simulator, and number of seeds: no rule of the daemon was tuned on them. Of the second
world, on which nothing is tuned, the first seeds are used."""

Data = list[tuple[Grasp, Looks]]


def main() -> None:
    """Record, fit and print."""
    parser = argparse.ArgumentParser(prog="python -m fit", description="Fit a posterior of slip.")
    parser.add_argument("--seeds", type=int, default=SEEDS, metavar="N", help="grasps of each family")
    parser.add_argument("--second", type=int, default=SECOND, metavar="N", help="the same in the second world")
    parser.add_argument("--folder", type=Path, default=cache_folder().with_name("fit"), help="folder of kept grasps")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="processes")
    parser.add_argument("--ablation", action="store_true", help="also fit without each source")
    options = parser.parse_args()
    seeds = {"first": range(FIRST, FIRST + options.seeds), "second": range(options.second)}
    worlds: dict[str, Data] = {
        world: [(one, looks(one)) for one in grasps(FAMILIES, of_world, options.folder, world, options.workers)]
        for world, of_world in seeds.items()
    }
    middle = FIRST + options.seeds // 2
    sets = {
        "fitted on": [one for one in worlds["first"] if one[0].seed < middle],
        "held out": [one for one in worlds["first"] if one[0].seed >= middle],
        "second world": worlds["second"],
    }
    told = bags(sets["fitted on"])
    weights = fit(told)
    print("weights, nats:", ", ".join(f"{name} {value:.2f}" for name, value in zip(SOURCES, weights, strict=True)))
    for name, data in sets.items():
        print(f"{name:14} rules      {line([score(grasp, today(grasp)) for grasp, _ in apart(data)])}")
        print(f"{name:14} posterior  {line([score(one[0], spans(*one, weights)) for one in apart(data)])}")
    if options.ablation:
        unseen = {name: bags(sets[name]) for name in ("held out", "second world")}
        for k, name in enumerate(SOURCES):
            if k not in (0, JUMP):
                without = fit(told, np.arange(len(SOURCES)) != k)
                changes = (f"{loss_of(data, without) - loss_of(data, weights):+.3f}" for data in unseen.values())
                print(f"without {name:14}", *changes)


def apart(data: Data) -> Data:
    """Return grasps of families that do not creep."""
    return [one for one in data if one[0].family not in CREEPS]


def line(scores: list[Score]) -> str:
    """Return the figures of some grasps in one line."""
    total = sum(scores, Score())
    by = " / ".join(f"{100.0 * a / max(n, 1):.0f}" for a, n in zip(total.reported, total.reached, strict=True))
    return (
        f"by 1 / 2 / 5 mm {by} % of {' / '.join(map(str, total.reached))}, never {total.never} of {total.far}, "
        f"false {total.false} of {total.grasps}"
    )


if __name__ == "__main__":
    main()
