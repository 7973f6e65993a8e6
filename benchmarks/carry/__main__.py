"""Measure objects that an arm carries: what is known of them, faults of the arm stream, and slip reports.

``PYTHONPATH=benchmarks:tests/support python -m carry PROGRAM [N [FIRST]]``: N grasps, from seed FIRST; see `PROGRAMS`.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from carry.faults import FAULTS
from carry.slips import measure_slips
from carry.weigh import LIFT_S, Carry, log_uniform, play

from slipd.types.arrays import Array

MASSES_KG = (0.1, 3.0)
TURN_S = LIFT_S + 1.0
MOST_TILT_DEG = 25.0


class Weighed(NamedTuple):
    """Errors of the object over their stated deviations, and the errors; NaN where it was not known.

    The inertia is that about the normal of the pads.
    """

    mass_part: float
    mass_stds: float
    com_m: float
    com_stds: Array
    inertia_part: float
    inertia_stds: float


def weighed(carry: Carry, body: dict[str, Any]) -> Weighed:
    """Return the errors of ``object`` in a message."""
    found, nothing = body["object"], np.full(3, np.nan)
    if found["mass_kg"] is None:
        return Weighed(np.nan, np.nan, np.nan, nothing, np.nan, np.nan)
    mass = found["mass_kg"] - carry.mass_kg
    known = found["com_m"] is not None
    com = np.array(found["com_m"]) - carry.com_m if known else nothing
    stds = com / np.array(found["com_std_m"]) if known else nothing
    inertia = np.nan if found["inertia_kgm2"] is None else found["inertia_kgm2"] - carry.inertia_kgm2
    inertia_std = found["inertia_std_kgm2"] or np.nan
    return Weighed(
        mass / carry.mass_kg, mass / found["mass_std_kg"], float(np.linalg.norm(com)), stds,
        inertia / carry.inertia_kgm2, inertia / inertia_std,
    )  # fmt: skip


def measure_weighing(count: int, first: int = 0) -> None:
    """Print accuracy and coverage before the turn and at the end."""
    before, after = [], []
    for seed in range(first, first + count):
        carry = Carry(np.random.default_rng(seed), log_uniform(np.random.default_rng((seed, 1)), *MASSES_KG))
        bodies = [(t_s, body) for t_s, topic, body in play(carry, seed) if topic == "grasp"]
        before.append(weighed(carry, [body for t_s, body in bodies if t_s < TURN_S][-1]))
        after.append(weighed(carry, bodies[-1][1]))
        print(seed, round(carry.mass_kg, 3), after[-1], bodies[-1][1]["object"]["unknown"], flush=True)
    for name, found in (("before the turn", before), ("after it", after)):
        mass, mass_stds, com, com_stds, *_ = (np.array(each) for each in zip(*found, strict=True))
        print(f"{name}: mass known in {np.isfinite(mass).sum()} of {count}, com in {np.isfinite(com).sum()}")
        if np.isfinite(mass).any():
            print(
                f"  mass error p95 {100 * np.nanpercentile(abs(mass), 95):.2f} %, within 2 std {_within(mass_stds):.3f}"
            )
        if np.isfinite(com).any():
            print(f"  com error p95 {1000 * np.nanpercentile(com, 95):.2f} mm, within 2 std {_within(com_stds):.3f}")


def measure_inertia(count: int, first: int = 0) -> None:
    """Print what is known of the inertia after a turn about an axis within 25° of the normal of the pads."""
    for size in (1.0, 2.0):
        found = []
        for seed in range(first, first + count):
            rng = np.random.default_rng((9, seed))
            tilt, around = math.radians(rng.uniform(0.0, MOST_TILT_DEG)), rng.uniform(0.0, 2.0 * math.pi)
            about = np.array((math.sin(tilt) * math.cos(around), math.cos(tilt), math.sin(tilt) * math.sin(around)))
            mass_kg = log_uniform(np.random.default_rng((seed, 1)), *MASSES_KG)
            carry = Carry(np.random.default_rng(seed), mass_kg, about=about, size=size)
            found.append(weighed(carry, [body for _, topic, body in play(carry, seed) if topic == "grasp"][-1]))
        part, stds = (np.array([each[k] for each in found]) for k in (-2, -1))
        print(
            f"{size:g} times as large: known in {np.isfinite(part).sum()} of {count}, error p95 "
            f"{100 * np.nanpercentile(abs(part), 95):.1f} %, within 2 std {_within(stds):.3f}, p50 of the std "
            f"{100 * np.nanmedian(part / stds):.0f} %",
            flush=True,
        )


def _within(stds: Array) -> float:
    known = stds[np.isfinite(stds)]
    return float((abs(known) < 2.0).mean())


def measure_faults(count: int, first: int = 0) -> None:
    """Print how often each fault is named while an object is carried, and while the fingers are free."""
    for held in (True, False):
        for name, (distort, word) in FAULTS.items():
            named, others, times = 0, Counter[str](), []
            for seed in range(first, first + count):
                mass_kg = log_uniform(np.random.default_rng((seed, 1)), *MASSES_KG) if held else 0.0
                carry = Carry(np.random.default_rng(seed), mass_kg, distort)
                messages = _arm_messages(carry, seed)
                hit = [t_s for t_s, text in messages if word and word in text]
                named += bool(hit)
                times += [motion_s(carry, t_s) for t_s in hit[:1]]
                others.update(text[:60] for text in {text for _, text in messages if not (word and word in text)})
            late = np.percentile(times, 95) if times else np.nan
            print(
                f"{'held' if held else 'free'}, {name}: named in {named} of {count}, p95 after {late:.2f} s of motion",
                flush=True,
            )
            for text, often in others.items():
                print(f"    {often}: {text}")


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


PROGRAMS: dict[str, Callable[..., None]] = {
    "weigh": measure_weighing,
    "inertia": measure_inertia,
    "faults": measure_faults,
    "slips": measure_slips,
}


def main() -> None:
    """Run one of the programs."""
    parser = argparse.ArgumentParser(prog="python -m carry", description=__doc__.splitlines()[0])
    parser.add_argument("program", choices=PROGRAMS)
    parser.add_argument("count", type=int, nargs="?", default=200, help="number of grasps (default: %(default)s)")
    parser.add_argument("first", type=int, nargs="?", default=0, help="seed of the first one (default: %(default)s)")
    chosen = parser.parse_args()
    PROGRAMS[chosen.program](chosen.count, chosen.first)


if __name__ == "__main__":
    main()
