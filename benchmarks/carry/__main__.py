"""Measure objects that an arm carries: what is known of them, faults of the arm stream, and slip reports.

``PYTHONPATH=benchmarks:tests/support python -m carry weigh|faults|slips [N]``
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from carry.scenes import carried
from carry.weigh import LIFT_S, Carry, Distortion, log_uniform, play
from evaluate import playing
from evaluate.reports import SLIPPING
from evaluate.running import Variant, record
from evaluate.running import reports as reports_of_run
from evaluate.scene import STEP_S, Kind, Scene
from evaluate.score import score
from simulated_grasp.trace import GraspTrace

from slipd.types.arrays import Array

MASSES_KG = (0.1, 3.0)
TURN_S = LIFT_S + 1.0
KINDS: tuple[Kind, ...] = ("safe", "slips")
WINDOW = round(0.15 / STEP_S)


class Weighed(NamedTuple):
    """Errors of the object over their stated deviations, and the errors; NaN where it was not known."""

    mass_part: float
    mass_stds: float
    com_m: float
    com_stds: Array


def weighed(carry: Carry, body: dict[str, Any]) -> Weighed:
    """Return the errors of ``object`` in a message."""
    found, nothing = body["object"], np.full(3, np.nan)
    if found["mass_kg"] is None:
        return Weighed(np.nan, np.nan, np.nan, nothing)
    mass = found["mass_kg"] - carry.mass_kg
    known = found["com_m"] is not None
    com = np.array(found["com_m"]) - carry.com_m if known else nothing
    stds = com / np.array(found["com_std_m"]) if known else nothing
    return Weighed(mass / carry.mass_kg, mass / found["mass_std_kg"], float(np.linalg.norm(com)), stds)


def measure_weighing(count: int) -> None:
    """Print accuracy and coverage before the turn and at the end."""
    before, after = [], []
    for seed in range(count):
        carry = Carry(np.random.default_rng(seed), log_uniform(np.random.default_rng((seed, 1)), *MASSES_KG))
        bodies = [(t_s, body) for t_s, topic, body in play(carry, seed) if topic == "grasp"]
        before.append(weighed(carry, [body for t_s, body in bodies if t_s < TURN_S][-1]))
        after.append(weighed(carry, bodies[-1][1]))
        print(seed, round(carry.mass_kg, 3), after[-1], bodies[-1][1]["object"]["unknown"], flush=True)
    for name, found in (("before the turn", before), ("after it", after)):
        mass, mass_stds, com, com_stds = (np.array(each) for each in zip(*found, strict=True))
        print(f"{name}: mass known in {np.isfinite(mass).sum()} of {count}, com in {np.isfinite(com).sum()}")
        if np.isfinite(mass).any():
            print(
                f"  mass error p95 {100 * np.nanpercentile(abs(mass), 95):.2f} %, within 2 std {_within(mass_stds):.3f}"
            )
        if np.isfinite(com).any():
            print(f"  com error p95 {1000 * np.nanpercentile(com, 95):.2f} mm, within 2 std {_within(com_stds):.3f}")


def _within(stds: Array) -> float:
    known = stds[np.isfinite(stds)]
    return float((abs(known) < 2.0).mean())


def _axes(matrix: Array) -> Distortion:
    return lambda gravity, omega, alpha: (gravity @ matrix.T, omega @ matrix.T, alpha @ matrix.T)


def _late(gravity: Array, omega: Array, alpha: Array) -> tuple[Array, Array, Array]:
    steps = 13  # of 4 ms
    return tuple(
        np.concatenate((np.repeat(each[:1], steps, axis=0), each[:-steps])) for each in (gravity, omega, alpha)
    )  # type: ignore[return-value]


FAULTS: dict[str, tuple[Distortion | None, str]] = {
    "none": (None, ""),
    "sign": (lambda gravity, omega, alpha: (-gravity, omega, alpha), "sign"),
    "axes swapped": (_axes(np.eye(3)[[1, 0, 2]]), "frame"),
    "turned by 90 degrees": (_axes(np.array(((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))), "frame"),
    "10 % more": (lambda gravity, omega, alpha: (1.1 * gravity, omega, alpha), "length"),
    "50 ms late": (_late, "late"),
}
"""Faults of a sender, and the word by which ``status`` names each."""


def measure_faults(count: int) -> None:
    """Print how often each fault is named while an object is carried, and while the fingers are free."""
    for held in (True, False):
        for name, (distort, word) in FAULTS.items():
            named, others, times = 0, Counter[str](), []
            for seed in range(count):
                mass_kg = log_uniform(np.random.default_rng((seed, 1)), *MASSES_KG) if held else 0.0
                carry = Carry(np.random.default_rng(seed), mass_kg, distort)
                messages = _arm_messages(carry, seed)
                hit = [t_s for t_s, text in messages if word and word in text]
                named += bool(hit)
                times += [motion_s(carry, t_s) for t_s in hit[:1]]
                others.update(text[:60] for text in {text for _, text in messages if not (word and word in text)})
            late = np.percentile(times, 95) if times else np.nan
            print(
                f"{'held' if held else 'free'}, {name}: named in {named} of {count}, p95 after {late:.2f} s of motion"
            )
            for text, often in others.items():
                print(f"    {often}: {text}")
            sys.stdout.flush()


def motion_s(carry: Carry, until_s: float) -> float:
    """Return for how long the gripper has moved until a time, s."""
    t_s = np.arange(0.0, until_s, 0.01)
    moves = np.linalg.norm(carry.acceleration(t_s), axis=1) > 0.3
    return 0.01 * float((moves | (np.linalg.norm(carry.felt(t_s)[1], axis=1) > 0.1)).sum())


def _arm_messages(carry: Carry, seed: int) -> list[tuple[float, str]]:
    found = []
    for t_s, topic, body in play(carry, seed):
        if topic == "status" and t_s > 1.2 and (text := body["streams"]["arm"]["message"]):
            found.append((t_s, text))
    return found


def measure_slips(count: int) -> None:
    """Print false slip reports, and slips that are reported in time, by a finger that does not know of the motion.

    A false report is explained where the load that the motion asks for falls by half as much as the measured one.
    """
    false, explained, reports, held, slid, found = 0, 0, 0, 0, 0, 0
    for seed in range(count):
        for kind in KINDS:
            scene = carried(seed, kind)
            trace = playing.play(scene)
            truth = playing.truth_of(scene, trace, needs=False)
            published = reports_of_run(scene, record(scene, trace, "", seed), Variant())
            figures = score(truth, published, steady=None, closed_s=scene.closed_s)
            long = [episode for episode in figures.episodes if episode.long]
            slid, found = slid + len(long), found + sum(not episode.missed for episode in long)
            if kind == "safe" and not figures.episodes:
                held, false = held + 1, false + (figures.false_slipping > 0)
                begun_s = [span.begin_s for span in published.spans(trace.t_s[-1]) if span.level == SLIPPING]
                reports, explained = (
                    reports + len(begun_s),
                    explained + sum(_explained(scene, trace, t) for t in begun_s),
                )
        print(
            f"{seed}: false in {false} of {held} grasps that hold, {explained} of {reports} reports explained;", end=" "
        )
        print(f"{found} of {slid} slips reported within 0.1 s", flush=True)


def _explained(scene: Scene, trace: GraspTrace, t_s: float) -> bool:
    """Return whether the load of the last 0.15 s falls by the motion, at least by half of what the finger measured."""
    end = int(np.searchsorted(trace.t_s, t_s))
    asked, carried_n = scene.load[:end][-WINDOW:, :2], 2.0 * trace.wrench_left[:end][-WINDOW:, :2]
    falls = [1.0 - size[-1] / size.max() for size in (np.linalg.norm(asked, axis=1), np.linalg.norm(carried_n, axis=1))]
    return bool(falls[0] >= 0.5 * falls[1] > 0.0)


PROGRAMS: dict[str, Callable[[int], None]] = {
    "weigh": measure_weighing,
    "faults": measure_faults,
    "slips": measure_slips,
}

if __name__ == "__main__":
    PROGRAMS[sys.argv[1]](int(sys.argv[2]) if len(sys.argv) > 2 else 200)
