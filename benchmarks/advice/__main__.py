"""Carry glasses with a capped grip, with and without advice.

    PYTHONPATH=tests/support:benchmarks python -m advice 200

Each grasp has its own mass, friction, stated friction, grip force and path, with peaks of 3 to 10 m/s². The engine, the
sensors and the robot program of ``slipd demo --scene carry`` run in simulated time; without advice it is the physical
simulator alone. The oracle knows the true friction, mass and force, and slows each move down by what must be.
"""

from __future__ import annotations

import argparse
import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from advice.safe_speed import holds_scale
from stepped_demo import PAD_HZ, SteppedDemo, slow_config

from slipd.tools.shipped_files import shipped_config
from slipd.tools.sim.carry import CARRY_PLAN, CarryProgram, Move, carry_config
from slipd.tools.sim.emulated_pvdf import PvdfElectronics
from slipd.tools.sim.scene import GripCommand
from slipd.tools.sim.scene_parts import GRAVITY_MPS2
from slipd.tools.sim.stickslip.stepped_grasp import FrictionLaw
from slipd.tools.sim.virtual_gripper import VirtualRig, carried_rig

PEAK = 10.0 / math.sqrt(3.0)
"""Largest acceleration of a minimum-jerk move, times the square of its time over its distance."""
LEAST_GRIP_N = 3.2
MU_SPREAD = 0.03
"""Error of the stated friction, as a part of it: what `slipctl friction measure` reaches."""


@dataclass(frozen=True)
class Grasp:
    """One glass, its grip and its path."""

    seed: int
    mass_kg: float
    mu: float
    stated_mu: float
    grip_n: float
    path: tuple[Move, ...]


@dataclass(frozen=True)
class Outcome:
    """What happened to one glass; times are those of the moves, s."""

    grasp: Grasp
    slips_without: int
    drops_without: int
    slips: int
    drops: int
    takes_s: tuple[float, ...]
    oracle_s: tuple[float, ...]
    known: tuple[bool, ...]
    scales: tuple[float, ...]
    error: str


def draw(seed: int) -> Grasp:
    """Return a random grasp whose grip holds the glass at rest with 30 to 55 % to spare."""
    rng = np.random.default_rng(seed)
    mu, used = rng.uniform(0.45, 0.8), rng.uniform(0.45, 0.7)
    grip_n = rng.uniform(LEAST_GRIP_N, 12.0)
    mass_kg = 2.0 * mu * grip_n * used / GRAVITY_MPS2
    moves = [Move("lift", 0.0, 0.10, 0.5)]
    for i in range(4):
        far_m, angle = rng.uniform(0.15, 0.5), rng.uniform(0.0, 2.0 * math.pi)
        moves.append(_move(f"move {i + 1}", far_m * math.cos(angle), far_m * math.sin(angle), rng.uniform(3.0, 10.0)))
    moves.append(_move("down", 0.0, -0.2, rng.uniform(3.0, 10.0)))
    return Grasp(seed, mass_kg, mu, mu * rng.normal(1.0, MU_SPREAD), grip_n, tuple(moves))


def _move(name: str, aside_m: float, up_m: float, peak_mps2: float) -> Move:
    return Move(name, aside_m, up_m, math.sqrt(PEAK * math.hypot(aside_m, up_m) / peak_mps2))


def rig_of(grasp: Grasp) -> VirtualRig:
    """Return the virtual gripper, its arm and its glass."""
    law = FrictionLaw(mu_s=grasp.mu, mu_d=0.75 * grasp.mu)
    rig = carried_rig(grasp.seed, PvdfElectronics(rate_hz=PAD_HZ), mass_kg=grasp.mass_kg, friction=law)
    assert rig.arm is not None
    rig.arm.path = grasp.path
    return rig


def count(rig: VirtualRig, event: str) -> int:
    """Return how often something happened to the glass."""
    return sum(truth.event == event for truth in rig.scene.truth)


def carried(grasp: Grasp, scales: list[float]) -> VirtualRig:
    """Carry the glass at these scales by the simulator alone."""
    rig, t_s = rig_of(grasp), 0.0
    assert rig.arm is not None
    while rig.arm.begun < len(grasp.path) or not rig.arm.arrived(t_s):
        t_s += 0.00125
        rig.scene.step(t_s, GripCommand(0.0, 0.05, grasp.grip_n))
        if t_s > 1.5 and rig.arm.begun < len(grasp.path):
            rig.arm.begin(t_s, scales[rig.arm.begun])
    return rig


def advised(grasp: Grasp) -> tuple[VirtualRig, CarryProgram]:
    """Carry the glass as slipd advises."""
    changes = (("mu = 0.58", f"mu = {grasp.stated_mu:.4f}"), ("max_force_n = 5.0", "max_force_n = 20.0"))
    text = slow_config(carry_config(shipped_config("demo.toml").read_text(encoding="utf-8")), *changes)
    rig = rig_of(grasp)
    arm, scene = rig.arm, rig.scene
    assert arm is not None
    demo = SteppedDemo(rig, text)
    program = CarryProgram(
        "",
        "",
        lambda scale: arm.begin(scene.t_s, scale),
        lambda: arm.begun - (not arm.arrived(scene.t_s)),
        advised=True,
        plan=replace(CARRY_PLAN, force_n=grasp.grip_n, limit_n=grasp.grip_n, close_s=0.8),
        path=grasp.path,
    )
    demo.play(program)
    return rig, program


def measure(seed: int) -> Outcome:
    """Return what happened to one glass."""
    grasp = draw(seed)
    without = carried(grasp, [1.0] * len(grasp.path))
    rig, program = advised(grasp)
    slowest = [holds_scale(move, grasp.mass_kg, grasp.grip_n, grasp.mu) for move in grasp.path]
    return Outcome(
        grasp,
        count(without, "slide_begins"),
        count(without, "dropped"),
        count(rig, "slide_begins"),
        count(rig, "dropped"),
        tuple(move.takes_s / scale for move, scale in zip(grasp.path, program.scales, strict=False)),
        tuple(move.takes_s / scale for move, scale in zip(grasp.path, slowest, strict=True)),
        tuple("limits it" in why or "holds it)" in why for _, why in program.report.moves),
        tuple(program.scales),
        program.report.error,
    )


def report(outcomes: list[Outcome]) -> None:
    """Print the figures of all glasses."""
    number = len(outcomes)
    ended = [each for each in outcomes if len(each.takes_s) == len(each.oracle_s)]
    print(f"grasps: {number}, carried to the end: {len(ended)}, errors: {sum(bool(each.error) for each in outcomes)}")
    print(f"without advice: slipped {sum(each.slips_without > 0 for each in outcomes)} of {number}", end="")
    print(f", dropped {sum(each.drops_without > 0 for each in outcomes)}")
    print(f"with advice: slipped {sum(each.slips > 0 for each in outcomes)} of {number}", end="")
    print(f", dropped {sum(each.drops > 0 for each in outcomes)}")
    cost = [sum(each.takes_s) / sum(each.oracle_s) - 1.0 for each in ended]
    mean, high = 100 * np.mean(cost), 100 * np.percentile(cost, 95)
    print(f"time of the moves beside the oracle: mean {mean:+.1f} %, p95 {high:+.1f} %")
    known = [
        (takes_s, oracle_s)
        for each in ended
        for takes_s, oracle_s, known in zip(each.takes_s, each.oracle_s, each.known, strict=False)
        if known
    ]
    moves = sum(len(each.takes_s) for each in ended)
    print(f"moves with known advice: {len(known)} of {moves}", end="")
    if known:
        takes, oracle = np.array(known).T
        print(f": time beside the oracle {100 * (takes.sum() / oracle.sum() - 1.0):+.1f} %", end="")
    print()


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(prog="python -m advice", description=__doc__)
    parser.add_argument("number", type=int, nargs="?", default=200, help="glasses (default: %(default)s)")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--each", action="store_true", help="print each glass")
    chosen = parser.parse_args()
    with ProcessPoolExecutor(chosen.processes) as pool:
        outcomes = []
        for outcome in pool.map(measure, range(chosen.number)):
            outcomes.append(outcome)
            if chosen.each:
                print(outcome, flush=True)
    report(outcomes)


if __name__ == "__main__":
    main()
