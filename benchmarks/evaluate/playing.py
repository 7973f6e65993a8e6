"""Play a scene: the physical simulation, and the truth of it."""

from __future__ import annotations

import math

import numpy as np
from evaluate.scene import STEP_S, Scene
from evaluate.truth import Truth
from simulated_grasp.general_grasp import GeneralGrasp
from simulated_grasp.trace import GraspTrace, empty_trace, write_sample

from slipd.fusion import utilisation
from slipd.types.arrays import Array

SAFETY = 1.3
"""Factor on the load for which ``grip_needed_n`` is asked: ``grip_safety`` of the config."""

TRUTH_EVERY = 4
"""Steps between two solutions of the true λ, linear between: 2 ms."""

NEED_EVERY_S = 0.05
"""Grid on which the true need of a contact that grows with its force is solved, s."""


def play(scene: Scene) -> GraspTrace:
    """Simulate a scene; the trace ends where the object is lost."""
    grasp = GeneralGrasp(
        scene.held, scene.patch, scene.friction, scene.compliance, grip_n=float(scene.grip_n[0]),
        largest_grip_n=float(scene.grip_n.max()),
    )  # fmt: skip
    n = len(scene.grip_n)
    trace = empty_trace(scene.patch, scene.friction, grasp, np.arange(n) * STEP_S)
    loads, grips = scene.load.tolist(), scene.grip_n.tolist()
    begin = n if scene.hand is None else int(scene.hand.path.any(axis=1).argmax())
    held_at = np.zeros(3)
    for i in range(n):
        if i == begin:
            held_at = grasp.displacement()
        if i:
            fx, fy, torque = load_at(scene, i, loads[i], grasp, held_at if i >= begin else None)
            grasp.advance(STEP_S, (fx, fy), torque, grips[i])
        write_sample(trace, i, grasp)
        if math.hypot(*trace.displacement[i, :2].tolist()) > scene.lost_m or abs(trace.displacement[i, 2]) > 1.0:
            return trace.until(i + 1)
    return trace


def load_at(
    scene: Scene, i: int, load: list[float], grasp: GeneralGrasp, held_at: Array | None
) -> tuple[float, float, float]:
    """Return the load at a step: what is given, and the spring of a hand that took the object at a displacement."""
    fx, fy, torque = load
    hand = scene.hand
    if hand is None or held_at is None:
        return fx, fy, torque
    (x, y, angle), (vx, vy, rate) = (grasp.displacement() - held_at).tolist(), grasp.velocity().tolist()
    (hx, hy, ha), (ux, uy, ur) = hand.path[i].tolist(), ((hand.path[i] - hand.path[i - 1]) / STEP_S).tolist()
    (kx, ky, ka), (cx, cy, ca) = hand.stiffness, hand.damping
    px, py = kx * (hx - x) + cx * (ux - vx), ky * (hy - y) + cy * (uy - vy)
    x0, y0 = scene.patch.centre_m  # where the hand holds it
    return fx + px, fy + py, torque + ka * (ha - angle) + ca * (ur - rate) + x0 * py - y0 * px


def truth_of(scene: Scene, trace: GraspTrace, *, every: int = TRUTH_EVERY, needs: bool = True) -> Truth:
    """Return the truth that metrics are held against.

    Args:
        scene: The scene.
        trace: Its simulation.
        every: Steps between two solutions of the true λ.
        needs: Also solve the grip force that holds the load.
    """
    indices = np.unique(np.append(np.arange(0, len(trace.t_s), every), len(trace.t_s) - 1))
    held = indices[trace.normal_n[indices] > 0.0]
    used = np.interp(trace.t_s, trace.t_s[held], np.nan_to_num(trace.utilisation_at(held), nan=0.0, posinf=9.9))
    v, rate = np.hypot(*trace.velocity[:, :2].T), np.abs(trace.velocity[:, 2])
    return Truth(
        t_s=trace.t_s,
        utilisation=used,
        speed_mps=np.hypot(v, rate * _gyration_m(scene)),
        gross=trace.gross & (trace.normal_n > 0.0),
        normal_n=trace.normal_n,
        needed_n=_needed_n(scene, trace, used) if needs else np.full(len(used), np.nan),
        mu=scene.friction.mu_s,
    )


def _gyration_m(scene: Scene) -> float:
    a, b = scene.patch.half_length_m, scene.patch.width_m
    return math.hypot(a, b) / 2.0  # of a uniform ellipse; those of the other shapes are within a quarter of it


def _needed_n(scene: Scene, trace: GraspTrace, used: Array) -> Array:
    """Return the least grip force that holds `SAFETY` times the load, with the size of the contact at that force."""
    if scene.patch.growth == 0.0:
        return SAFETY * used * trace.normal_n
    indices = np.flatnonzero((np.arange(len(used)) % round(NEED_EVERY_S / STEP_S) == 0) & (used > 0.1) & (used < 1.0))
    if indices.size == 0:
        return np.full(len(used), np.nan)
    needs = [_grown_need_n(scene, trace, int(i), float(used[i])) for i in indices]
    return np.interp(trace.t_s, trace.t_s[indices], needs, left=np.nan, right=np.nan)


def _grown_need_n(scene: Scene, trace: GraspTrace, i: int, used: float) -> float:
    """Solve λ(f) = 1 by bisection in the grip force f, while the contact scales about its centre."""
    cells, normal = trace.pressure(i), float(trace.normal_n[i])
    cx, cy = scene.patch.centre_m
    force, spin = SAFETY * trace.wrench_left[i, :2], SAFETY * trace.wrench_left[i, 5]

    def holds(grip_n: float) -> bool:
        size, load = (grip_n / normal) ** scene.patch.growth, grip_n / normal
        x, y = cx + size * (cells.x_m - cx), cy + size * (cells.y_m - cy)
        return utilisation(x, y, load * cells.holds_n, scene.friction.mu_s, force, spin, (0.0, 0.0)).value <= 1.0

    low, high = 0.3 * used * normal, 2.0 * normal
    while high / low > 1.002:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high
