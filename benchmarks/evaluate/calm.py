"""False alarms over hours: long grasps that hold and shake, from sensors to engine.

    PYTHONPATH=tests/support:benchmarks .venv/bin/python -m evaluate.calm --hours 3

Every grasp lasts a minute, with a draw of its own: object, contact, friction, noise,
load, and a μ of the config that is 0.9, 1.0 or 1.1 times the true one. So no two runs share their noise, and the
Poisson bounds hold. Reads are 10 ms apart, and the true λ is solved every 10 ms: loads change by at most 8 Hz.
``--world second`` plays them in the world of other physics.
``--minutes`` limits the time that it takes; the page states the hours that were run. Metrics: `evaluate.score`.
"""

from __future__ import annotations

import argparse
import sys
import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from bench.commit import measured_on
from bench.tables import Table
from evaluate.draw import Random
from evaluate.families import EVALUATION
from evaluate.intervals import rate_upper
from evaluate.loads_that_hold import hold, shake
from evaluate.offline_grasp import BEGIN_NS, run_offline
from evaluate.playing import play, truth_of
from evaluate.reports import reports_of
from evaluate.running import Variant, config_text
from evaluate.scene import STEP_S, Scene
from evaluate.score import RunScore, score
from evaluate.truth import Truth
from evaluate.worlds import WORLDS
from project import MEASURED
from second_world import rubber_scene, rubber_trace

SECONDS = 60.0
READ_NS = 10_000_000
SOLVED_EVERY = round(0.01 / STEP_S)
FEW_VERDICTS = "slip_hz = 20.0\n"
"""Line of ``[rates]``; a change of level is always published."""

FACTORS = (0.9, 1.0, 1.1)
FAMILIES: dict[str, Callable[[Random, float], Scene]] = {"hold": hold, "shake": shake}

INTRODUCTION = """\
How often does slipd raise a false alarm where nothing happens? Grasps of {seconds:.0f} s, drawn as those of families
*hold* and *shake* of [the quality of the warnings](warning_quality.md), where each figure is defined; simulated, sent
as bytes of the sensors, and judged by the engine as there. μ of the config is 0.9, 1.0 or 1.1 times the true one.
`python -m evaluate.calm` makes this page."""


@dataclass(frozen=True, slots=True)
class Minute:
    """One grasp: its family, its seed, μ of the config over the true one, and its world, see `evaluate.worlds`."""

    family: str
    seed: int
    factor: float
    world: str = "first"


def minutes(world: str = "first") -> Iterator[Minute]:
    """Yield the grasps, families and factors in turn."""
    for seed in EVALUATION:
        for family in FAMILIES:
            yield Minute(family, seed, FACTORS[seed % len(FACTORS)], world)


def draw(minute: Minute, seconds: float = SECONDS) -> Scene:
    """Draw the scene of a grasp; in every second one, the contact moves with the object."""
    rng = np.random.default_rng((zlib.crc32(f"calm {minute.family}".encode()), minute.seed))
    scene = FAMILIES[minute.family](rng, seconds)
    return replace(scene, patch=replace(scene.patch, moves_with_object=bool(minute.seed % 2)))


def played(minute: Minute, seconds: float) -> tuple[Any, Any, Truth]:
    """Return the scene of a grasp in its world, its trace, and the truth."""
    scene = draw(minute, seconds)
    if minute.world == "second":
        scene = rubber_scene.transposed(scene, zlib.crc32(f"second calm {minute.family} {minute.seed}".encode()))
        trace = rubber_trace.play(scene, SOLVED_EVERY)
        return scene, trace, rubber_trace.truth_of(scene, trace)
    trace = play(scene)
    return scene, trace, truth_of(scene, trace, every=SOLVED_EVERY, needs=False)


def run(minute: Minute, seconds: float = SECONDS) -> RunScore:
    """Simulate a grasp, run it through sensors and engine, and score it."""
    scene, trace, truth = played(minute, seconds)
    text = config_text(scene, Variant(minute.factor, extra=FEW_VERDICTS))
    noise = zlib.crc32(f"calm {minute.family} {minute.seed}".encode())
    heard = run_offline(trace, {"left": scene.sensors}, text, noise, read_ns=READ_NS)
    bodies = ((one.t_ns + BEGIN_NS, one.body) for one in heard if one.topic == "slip.left" and one.t_ns >= 0)
    return score(truth, reports_of(bodies, BEGIN_NS), steady=scene.steady, closed_s=scene.closed_s)


def run_all(hours: float, workers: int, until_s: float, world: str = "first") -> list[tuple[Minute, RunScore]]:
    """Run grasps until they are so long together, or until a time of ``time.monotonic``."""
    found: list[tuple[Minute, RunScore]] = []
    with ProcessPoolExecutor(workers) as pool:
        left = islice(minutes(world), max(round(3600.0 * hours / SECONDS), 1))
        while batch := {pool.submit(run, minute): minute for minute in islice(left, 4 * workers)}:
            found += [(batch[done], done.result()) for done in as_completed(batch)]
            print(f"{len(found) * SECONDS / 3600.0:.2f} h", flush=True)
            if time.monotonic() > until_s:
                break
    return found


def table(found: Sequence[tuple[Minute, RunScore]]) -> Table:
    """Return the false alarms of each family, and of both together."""
    made = Table(
        "False alarms",
        ("family", "grasps", "h", "false `slipping`", "upper bound, 1/h", "h with λ < 0.7", "false warnings",
         "upper bound, 1/h"),
        notes=["Bounds are Poisson, one-sided, 95 %. Gross slips in truth: "
               f"{sum(len(one.episodes) for _, one in found)}."],
    )  # fmt: skip
    for name in (*FAMILIES, "both"):
        scores = [one for minute, one in found if name in (minute.family, "both")]
        quiet_h, safe_h = (sum(getattr(one, key) for one in scores) / 3600.0 for key in ("quiet_s", "safe_s"))
        slips, warnings = (sum(getattr(one, key) for one in scores) for key in ("false_slipping", "false_warnings"))
        made.rows.append((
            name, len(scores), f"{quiet_h:.2f}", slips, f"{rate_upper(slips, quiet_h):.2f}", f"{safe_h:.2f}", warnings,
            f"{rate_upper(warnings, safe_h):.2f}",
        ))  # fmt: skip
    return made


def main(argv: Sequence[str] | None = None) -> int:
    """Run, and write the page."""
    parser = argparse.ArgumentParser(prog="python -m evaluate.calm", description="Count false alarms over hours.")
    parser.add_argument("--hours", type=float, default=3.0, metavar="H", help="simulated hours (default 3)")
    parser.add_argument("--minutes", type=float, default=600.0, metavar="M", help="no new grasps after")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="processes (default 1)")
    parser.add_argument("--into", type=Path, default=MEASURED, metavar="FOLDER", help="folder of the page")
    parser.add_argument("--world", choices=WORLDS, default="first", help="which simulated world (default: first)")
    options = parser.parse_args(argv)
    header = measured_on()
    found = run_all(options.hours, max(options.workers, 1), time.monotonic() + 60.0 * options.minutes, options.world)
    title = "Calm hours" if options.world == "first" else f"Calm hours, {options.world} world"
    text = f"# {title}\n\n{header}.\n\n{INTRODUCTION.format(seconds=SECONDS)}\n{table(found).markdown()}\n"
    (options.into / "calm_hours.md").write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
