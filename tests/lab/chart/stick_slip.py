"""The simulated grasp against closed forms and the exact limit surface; its convergence and its cost."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from bench.tables import Table
from stick_slip_scenes import GRIP_N, PAD, STEADY, history, kinetic_j, onset, ramp, simulate

from slipd.fusion import utilisation
from slipd.tools.sim.stickslip import ContactPatch, FrictionLaw, GraspTrace
from slipd.tools.sim.true_contact import Pad
from slipd.types.arrays import Array

A = 0.010
MU = STEADY.mu_s
PADS = 2
NOTHING = (0.0, 0.0, 0.0)
FINE_M = 0.0005

LEVERS = {
    "uniform disc": (ContactPatch("disc", A, None, exponent=0.0), 2 / 3 * A),
    "Hertz's disc": (ContactPatch("disc", A, None), 3 * math.pi / 16 * A),
    "uniform ring": (ContactPatch("ring", A, None, exponent=0.0), 2 / 3 * A * (1 - 0.6**3) / (1 - 0.6**2)),
    "uniform square": (ContactPatch("square", A, None, exponent=0.0), A * (math.sqrt(2) + math.asinh(1)) / 3),
}
"""Contacts, and the torque limit of each over friction times normal force, m."""

SHAPES = {name: ContactPatch(name, A, 0.7 * A) for name in ("disc", "rectangle", "ring", "two_strips")}
MIXES = np.linspace(0.0, 1.0, 9)
"""From a pull alone to a twist alone."""

DROPS = FrictionLaw(mu_s=0.6, mu_d=0.45, stribeck_mps=0.02)
STEPS_S = (2.5e-4, 1e-4, 5e-5, 2.5e-5)
CELLS_M = (0.002, 0.0015, 0.001, 0.0005)
FINEST_STEP_S, FINEST_CELL_M = 5e-6, 0.0002
PEAKS = (0.35, 0.6, 0.85, 0.97)
"""Displacements at which a load turns back, over that at which the last cell slides."""


@dataclass(frozen=True, slots=True, eq=False)
class Limit:
    """The limit surface of a shape and what sliding contacts carry, as pairs (pull / μf, twist / μfa)."""

    exact: Array
    carried: Array
    utilisation: Array


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """A pull that rises and falls: displacement over that of full sliding, pull over the limit, sliding share."""

    displacement: Array
    pull: Array
    share: Array


@dataclass(frozen=True, slots=True)
class Fineness:
    """A slip with a step or cell: when it begins, s; error of the displacement 60 ms later; unbalanced energy."""

    size: float
    onset_s: float
    displacement_error: float
    unbalanced: float


@dataclass(frozen=True, slots=True, eq=False)
class Study:
    """All results."""

    turned_nm: dict[str, tuple[float, float]]
    limits: dict[str, Limit]
    loops: list[Loop]
    slide: GraspTrace
    steps: list[Fineness]
    cells: list[Fineness]
    real_time: list[tuple[float, int, float]]


def run(quick: bool) -> Study:
    """Simulate everything, or a little."""
    return Study(
        turned_nm={name: _turned(*case) for name, case in list(LEVERS.items())[: 1 if quick else None]},
        limits={name: limit(patch, quick) for name, patch in list(SHAPES.items())[: 1 if quick else None]},
        loops=[loop(peak) for peak in PEAKS[: 1 if quick else None]],
        slide=stick_and_slide(),
        steps=fineness("step_s", STEPS_S[: 1 if quick else None], 5e-5 if quick else FINEST_STEP_S),
        cells=fineness("cell_m", CELLS_M[: 1 if quick else None], 0.001 if quick else FINEST_CELL_M),
        real_time=[_real_time(cell) for cell in CELLS_M[1:3]],
    )


def _turned(patch: ContactPatch, lever_m: float) -> tuple[float, float]:
    """Return the torque limit of one pad by the closed form, and the largest torque that it carries, N·m."""
    expected = MU * GRIP_N * lever_m
    trace = simulate(patch, STEADY, ramp((0.0, 0.0, 3.2 * expected)), cell_m=FINE_M)
    return expected, float(np.abs(trace.wrench_left[:, 5]).max())


def limit(patch: ContactPatch, quick: bool) -> Limit:
    """Slide a contact along several loads, and find its exact limit on a finer grid."""
    cells = simulate(patch, STEADY, ramp(NOTHING, 0.001), cell_m=A / 40).pressure(0)
    size = np.array((MU * GRIP_N, MU * GRIP_N * A))

    def used(pull: float, twist: float) -> float:
        force = np.array((pull, 0.0))
        return utilisation(cells.x_m, cells.y_m, cells.loads_n, MU, force, twist, (0.0, 0.0)).value

    angles = np.linspace(0.0, math.pi / 2, 30)
    exact = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    exact = exact / np.array([[used(*(point * size).tolist())] for point in exact])
    carried, share = [], []
    for mix in MIXES[4:5] if quick else MIXES:
        load = (PADS * 1.8 * size[0] * (1 - mix), 0.0, PADS * 1.8 * size[1] * 0.7 * mix)
        trace = simulate(patch, STEADY, ramp(load), cell_m=0.001)
        for wrench in trace.wrench_left[onset(trace) :: 40]:
            pull, twist = math.hypot(wrench[0], wrench[1]), abs(float(wrench[5]))
            carried.append(np.array((pull, twist)) / size)
            share.append(utilisation(cells.x_m, cells.y_m, cells.loads_n, MU, wrench[:2], wrench[5], (0.0, 0.0)).value)
    return Limit(exact, np.array(carried), np.array(share))


def loop(peak: float) -> Loop:
    """Pull Hertz's disc to a part of the limit and back."""
    last_m = MU * GRIP_N * 1.5 / (math.pi * A**2) / PAD.stiffness_n_per_m3
    top = (PADS * MU * GRIP_N * float(winkler(np.array(peak))), 0.0, 0.0)
    trace = simulate(
        ContactPatch("disc", A, None), STEADY, history([NOTHING, top, NOTHING], [0.0, 0.7, 1.4]), cell_m=FINE_M
    )
    return Loop(trace.displacement[:, 0] / last_m, trace.wrench_left[:, 0] / (MU * GRIP_N), trace.sliding_share)


def winkler(s: Array) -> Array:
    """Return the load over the limit at a displacement, as in `Loop`: Hertz's disc on bristles."""
    return np.asarray(1.5 * s - 0.5 * s**3)


def stick_and_slide() -> GraspTrace:
    """Return a box that is pulled until it slides, and gripped harder until it sticks."""
    loads = [NOTHING, (12.6, 0.0, 0.02), (12.6, 0.0, 0.02), (12.6, 0.0, 0.02), (12.6, 0.0, 0.02)]
    times, grip = [0.0, 0.42, 0.44, 0.45, 0.55], [10.0, 10.0, 10.0, 30.0, 30.0]
    return simulate(ContactPatch("rounded", 0.018, 0.009), DROPS, history(loads, times, grip))


def fineness(name: str, sizes: tuple[float, ...], finest: float) -> list[Fineness]:
    """Simulate the same slip with several sizes of a step or a cell, and hold them against the finest."""
    reference = _slip(**{name: finest})
    moved = reference.displacement[-1, :2]
    found = []
    for size in sizes:
        trace = _slip(**{name: size})
        error = float(np.hypot(*(trace.displacement[-1, :2] - moved)) / np.hypot(*moved))
        work, slid, damped, stored = trace.energy[-1]
        rest = float(abs(work - slid - damped - stored - kinetic_j(trace)) / work)
        found.append(Fineness(size, float(trace.t_s[onset(trace)]), error, rest))
    return found


def _slip(**fine: float) -> GraspTrace:
    load = history([NOTHING, (13.0, 0.0, 0.04)], [0.0, 0.5])
    return simulate(ContactPatch("rounded", 0.018, 0.009), DROPS, load, **fine)


def _real_time(cell_m: float) -> tuple[float, int, float]:
    """Return cell, number of cells, and simulated seconds per second of one core, with images at 200 Hz of one pad."""
    load = ramp((9.0, 0.0, 0.02), 2.0)
    seconds = math.inf
    for _ in range(3):
        begin = time.process_time()
        trace = simulate(ContactPatch("rounded", 0.018, 0.009, growth=0.2), STEADY, load, cell_m=cell_m)
        trace.taxel_loads(Pad(), np.arange(0.0, 2.0, 0.005))
        seconds = min(seconds, time.process_time() - begin)
    return cell_m, trace.contact.cells.shape[1], 2.0 / seconds


def tables(study: Study) -> list[Table]:
    """Return what was found, as tables."""
    turned = Table("Torque at which a contact turns, mN·m", ("contact", "closed form", "simulated", "error %"))
    for name, (expected, found) in study.turned_nm.items():
        turned.rows.append((name, 1e3 * expected, 1e3 * found, 100 * (found / expected - 1)))
    turned.notes.append("One pad, μ 0.5, 10 N, half length 10 mm, cells of 0.5 mm.")
    surface = Table("True λ of what a sliding contact carries", ("contact", "loads", "lowest", "median", "highest"))
    for name, found in study.limits.items():
        low, middle, high = (f"{x:.3f}" for x in np.quantile(found.utilisation, (0.0, 0.5, 1.0)))
        surface.rows.append((name, len(found.utilisation), low, middle, high))
    surface.notes.append(
        "Pulls and twists together, μ_s = μ_d, from the first sample at which the object slides as a whole. "
        "1 is the exact limit surface of a grid of 0.25 mm; below 1, a core near the pole still sticks."
    )
    return [turned, surface, _fine("step", 1e3, study.steps), _fine("cell", 1e3, study.cells), _cost(study)]


def _fine(name: str, scale: float, found: list[Fineness]) -> Table:
    unit = "ms" if name == "step" else "mm"
    head = (f"{name}, {unit}", "slip begins, ms", "error of the displacement %", "energy not balanced %")
    table = Table(f"One slip with a finer {name}", head)
    for one in found:
        error, rest = f"{100 * one.displacement_error:.2f}", f"{100 * one.unbalanced:.2f}"
        table.rows.append((f"{scale * one.size:g}", f"{1e3 * one.onset_s:.0f}", error, rest))
    orders = [
        math.log(b.displacement_error / a.displacement_error) / math.log(b.size / a.size) for a, b in pairwise(found)
    ]
    if orders and name == "step":
        table.notes.append(f"Order of convergence of the displacement: {np.median(orders):.1f}.")
    table.notes.append("Displacement about 60 ms after the onset, when the object slides at 0.6 m/s.")
    return table


def _cost(study: Study) -> Table:
    table = Table("Simulated seconds per second of one core", ("cell, mm", "cells", "factor"))
    for cell_m, cells, factor in study.real_time:
        table.rows.append((f"{1e3 * cell_m:g}", cells, factor))
    table.notes.append("Both wrenches at 1 kHz and 128 taxels at 200 Hz, patch growing with the force.")
    return table
