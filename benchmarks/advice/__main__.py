"""Carry glasses with a capped grip, with and without advice.

    PYTHONPATH=tests/support:benchmarks python -m advice 200

Each grasp has its own mass, friction, stated friction, grip force and path, with peaks of 3 to 10 m/s². The engine, the
sensors and the robot program of ``slipd demo --scene carry`` run in simulated time; without advice it is the physical
simulator alone. Each glass is carried twice with advice: slipd learns it in the first carry, and knows it by its name
in the second, gripped some millimetres from where it was. The oracle knows the true friction, mass and force, and slows
each move down by what must be.
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
from slipd.tools.sim.carry import CARRY_PLAN, Arm, CarryProgram, CarryScript, Move, carry_config
from slipd.tools.sim.emulated_pvdf import PvdfElectronics
from slipd.tools.sim.scene import GripCommand
from slipd.tools.sim.scene_parts import GRAVITY_MPS2
from slipd.tools.sim.stepped_grasp import FrictionLaw
from slipd.tools.sim.virtual_gripper import VirtualRig, carried_rig

PEAK = 10.0 / math.sqrt(3.0)
"""Largest acceleration of a minimum-jerk move, times the square of its time over its distance."""
LEAST_GRIP_N = 3.2
MU_SPREAD = 0.03
"""Error of the stated friction, as a part of it: what `slipctl friction measure` reaches."""
REGRIP_STD_M = 0.002
"""How far the second grip of a glass is from the first one, as the config states it."""
SAFETY = 1.0
"""Factor on the load: what is not known of friction and object is the margin."""


@dataclass(frozen=True)
class Grasp:
    """One glass, its grip and its path."""

    seed: int
    mass_kg: float
    mu: float
    stated_mu: float
    grip_n: float
    path: tuple[Move, ...]
    com_m: tuple[float, float]


@dataclass(frozen=True)
class Carry:
    """One carry of a glass, with the time that each move took, s; the error is what ended the program early."""

    slips: int
    drops: int
    takes_s: tuple[float, ...]
    error: str = ""


@dataclass(frozen=True)
class Outcome:
    """What happened to one glass: without advice, in the first carry with it, and in the second.

    Attributes:
        grasp: The glass.
        without: The carry at full speed.
        advised: The carries with advice.
        oracle_s: Times of the fastest moves that hold.
    """

    grasp: Grasp
    without: Carry
    advised: tuple[Carry, Carry]
    oracle_s: tuple[float, ...]


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
    x_m, y_m = rng.normal(0.0, REGRIP_STD_M, 2)
    return Grasp(seed, mass_kg, mu, mu * rng.normal(1.0, MU_SPREAD), grip_n, tuple(moves), (float(x_m), float(y_m)))


def _move(name: str, aside_m: float, up_m: float, peak_mps2: float) -> Move:
    return Move(name, aside_m, up_m, math.sqrt(PEAK * math.hypot(aside_m, up_m) / peak_mps2))


def rig_of(grasp: Grasp) -> VirtualRig:
    """Return the virtual gripper and its glass."""
    law = FrictionLaw(mu_s=grasp.mu, mu_d=0.75 * grasp.mu)
    return carried_rig(grasp.seed, PvdfElectronics(rate_hz=PAD_HZ), mass_kg=grasp.mass_kg, friction=law)


def begin(rig: VirtualRig, grasp: Grasp, com_m: tuple[float, float]) -> Arm:
    """Put the arm at the begin of the path, and the centre of mass beside the middle of the grip."""
    rig.arm = Arm(grasp.path)
    rig.scene.script = CarryScript(arm=rig.arm, com_m=com_m)
    return rig.arm


def count(rig: VirtualRig, event: str) -> int:
    """Return how often something happened to the glass."""
    return sum(truth.event == event for truth in rig.scene.truth)


def carried(grasp: Grasp, scales: list[float]) -> VirtualRig:
    """Carry the glass at these scales by the simulator alone."""
    rig, t_s = rig_of(grasp), 0.0
    arm = begin(rig, grasp, (0.0, 0.0))
    while arm.begun < len(grasp.path) or not arm.arrived(t_s):
        t_s += 0.00125
        rig.scene.step(t_s, GripCommand(0.0, 0.05, grasp.grip_n))
        if t_s > 1.5 and arm.begun < len(grasp.path):
            arm.begin(t_s, scales[arm.begun])
    return rig


def advised(grasp: Grasp) -> tuple[Carry, Carry]:
    """Carry the glass twice as slipd advises."""
    changes = (
        ("mu = 0.58", f"mu = {grasp.stated_mu:.4f}"),
        ("max_force_n = 5.0", "max_force_n = 20.0"),
        ("grip_safety = 1.1", f"grip_safety = {SAFETY}"),
    )
    text = slow_config(carry_config(shipped_config("demo.toml").read_text(encoding="utf-8")), *changes)
    rig = rig_of(grasp)
    demo = SteppedDemo(rig, text)
    return _advised(demo, grasp, (0.0, 0.0)), _advised(demo, grasp, grasp.com_m)


def _advised(demo: SteppedDemo, grasp: Grasp, com_m: tuple[float, float]) -> Carry:
    rig, scene = demo.rig, demo.rig.scene
    before = count(rig, "slide_begins"), count(rig, "dropped")
    arm = begin(rig, grasp, com_m)
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
    takes_s = tuple(move.takes_s / scale for move, scale in zip(grasp.path, program.scales, strict=False))
    slips, drops = count(rig, "slide_begins") - before[0], count(rig, "dropped") - before[1]
    return Carry(slips, drops, takes_s, program.report.error)


def measure(seed: int) -> Outcome:
    """Return what happened to one glass."""
    grasp = draw(seed)
    rig = carried(grasp, [1.0] * len(grasp.path))
    without = Carry(count(rig, "slide_begins"), count(rig, "dropped"), tuple(move.takes_s for move in grasp.path))
    slowest = [holds_scale(move, grasp.mass_kg, grasp.grip_n, grasp.mu) for move in grasp.path]
    oracle_s = tuple(move.takes_s / scale for move, scale in zip(grasp.path, slowest, strict=True))
    return Outcome(grasp, without, advised(grasp), oracle_s)


def report(outcomes: list[Outcome]) -> None:
    """Print the figures of all glasses."""
    oracles_s = [each.oracle_s for each in outcomes]
    _print("without advice", [each.without for each in outcomes], oracles_s)
    for k, name in enumerate(("first carry with advice", "second carry with advice")):
        _print(name, [each.advised[k] for each in outcomes], oracles_s)


def _print(name: str, carries: list[Carry], oracles_s: list[tuple[float, ...]]) -> None:
    slips, drops = sum(each.slips > 0 for each in carries), sum(each.drops > 0 for each in carries)
    ended = [
        sum(each.takes_s) / sum(oracle_s) - 1.0
        for each, oracle_s in zip(carries, oracles_s, strict=True)
        if len(each.takes_s) == len(oracle_s)
    ]
    print(f"{name}: {len(carries)} glasses, {slips} slipped, {drops} dropped, {len(carries) - len(ended)} not carried")
    if ended:
        mean, high = 100 * np.mean(ended), 100 * np.percentile(ended, 95)
        print(f"    time of the moves beside the fastest that hold: mean {mean:+.1f} %, p95 {high:+.1f} %")
    for why in {each.error for each in carries if each.error}:
        print(f"    ended early: {why}")


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(prog="python -m advice", description=__doc__.splitlines()[0])
    parser.add_argument("number", type=int, nargs="?", default=200, help="glasses (default: %(default)s)")
    parser.add_argument("--processes", type=int, default=1, help="default: %(default)s")
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
