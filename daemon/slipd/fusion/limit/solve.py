"""The questions about one contact: torque limit and utilisation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.limit.bounds import Bracket, Plane
from slipd.fusion.limit.frame import Frame, Load, U, normalise, slip_margin, split
from slipd.fusion.limit.newton import MET_AT_KINK, OPEN, descend
from slipd.fusion.limit.path import BESIDE, follow_path
from slipd.fusion.limit.sweep import Twist, sharpest
from slipd.types.arrays import Array

KINDS = ("interior", "hinge", "translating", "none")
INTERIOR, HINGE, TRANSLATING, NONE = range(4)
NO_TWIST = Twist(math.nan, math.nan, math.nan)
FAR = 1e9  # a pole this many mean distances away is a translation for every purpose
GOAL = 2e-13  # gap of the bounds at which an answer is as good as its rounding bound
GOAL_SLACKS = 30.0  # which is less than so many σ
MAX_PASSES = 120  # ordinary scenes need 3–7, hinges some 20; the bounds show a gap that stays open
ASKEW = 20.0  # a start is dropped where its power is less than its size by this factor: it belongs to another load


class Stop(NamedTuple):
    """When to stop: at a gap of the bounds, or after so many passes over the taxels."""

    gap: float
    passes: int


class LimitAnswer(NamedTuple):
    """Torque limit: kind (index of `KINDS`), torque with its bounds, N·m, and pole, m; NaN where there is none."""

    kind: int
    torque: float
    lower: float
    upper: float
    pole_x: float
    pole_y: float


class UtilisationAnswer(NamedTuple):
    """Utilisation: kind (index of `KINDS`), λ with its bounds, pole, m, and twist about the load's point."""

    kind: int
    value: float
    lower: float
    upper: float
    pole_x: float
    pole_y: float
    vx: float
    vy: float
    omega: float


@compiled_part
def disc_lean(rho: float) -> float:
    """Return how much farther a uniform disc's pole lies than the ellipsoid's ρ/√(1 − ρ²): 3/2 at ρ = 0, 3/4 at 1.

    As a start this is within some 15 % for most contacts.
    """
    return 1.5 - 0.75 * rho * rho


@compiled_part
def minimise(
    x: Array, y: Array, frame: Frame, taxels: Array, start: Twist, plane: Plane, stop: Stop
) -> tuple[Bracket, Twist, int]:
    """Minimise Σ w c(q) + h v_x over the plane until the bounds meet.

    Newton's method where the sum is smooth, the central path where a kink comes into play. The sum is convex and both
    descend, so it converges from anywhere.

    Args:
        x: Taxel centres as given, shape (n,), m.
        y: Likewise.
        frame: The contact's own units.
        taxels: The contact in these units, shape (3, n).
        start: The twist to start from, in the plane.
        plane: The question.
        stop: When to stop; `Stop.passes` counts passes of the first part and steps of both.

    Returns:
        The bounds with the value of the last twist; that twist; the index of the taxel that is a hinge (−1: none).
    """
    xs, ys, w = split(taxels)
    goal = max(stop.gap, GOAL_SLACKS * (x.size + 16) * U)
    found, q, state, done = descend(xs, ys, w, start, plane, goal, stop.passes)
    hinge = -1
    if state == MET_AT_KINK:
        j = sharpest(xs, ys, w, q.vx, q.vy, q.omega)
        ux, uy = q.vx - q.omega * ys[j], q.vy + q.omega * xs[j]
        if abs(ux) + abs(uy) <= BESIDE * (abs(q.vx) + abs(q.vy) + abs(q.omega)):
            hinge = j
    elif state == OPEN and done < stop.passes:
        found, q, hinge, _ = follow_path(x, y, frame, taxels, q, plane, goal, found, stop.passes - done)
    return Bracket(found.lower, found.upper, min(max(found.value, found.lower), found.upper)), q, hinge


@compiled
def solve_torque_limit(
    x: Array, y: Array, loads: Array, mu: float, fx: float, fy: float, ax: float, ay: float, sense: int, gap: float,
    passes: int,
) -> tuple[int, float, float, float, float, float]:  # fmt: skip
    """Find the largest spin torque beside (fx, fy) about (ax, ay), as the numbers of a `LimitAnswer`."""
    a = torque_limit_of(x, y, loads, mu, Load(fx, fy, 0.0, ax, ay), sense, Stop(gap, passes), np.empty((3, x.size)))
    return a.kind, a.torque, a.lower, a.upper, a.pole_x, a.pole_y


@compiled_part
def torque_limit_of(
    x: Array, y: Array, loads: Array, mu: float, load: Load, sense: int, stop: Stop, taxels: Array
) -> LimitAnswer:
    """Find the largest spin torque that friction carries beside a tangential force.

    Args:
        x: Taxel centres, shape (n,), m.
        y: Likewise.
        loads: Normal forces, shape (n,), N.
        mu: Coefficient of friction.
        load: The force and the point; its spin is not used.
        sense: ±1. Sense −1 is solved with the force reversed: the mirror image has the same pole.
        stop: When to stop.
        taxels: Working memory, shape (3, n).

    Source: paper eqs. (5) and (7) as the minimum of the friction power over ω = 1.
    """
    nan = math.nan
    fx, fy, ax, ay = load.fx, load.fy, load.ax, load.ay
    frame = normalise(x, y, loads, sense * fx, sense * fy, taxels)
    if not frame.total > 0.0 or not math.isfinite(fx + fy + ax + ay):
        return LimitAnswer(NONE, nan, nan, nan, nan, nan)
    mean = frame.mean
    grip, force = mu * frame.total, math.hypot(fx, fy)
    dx, dy = (ax - frame.cx) - frame.ex, (ay - frame.cy) - frame.ey
    shift = -sense * (dx * fy - dy * fx)  # m about a = m about c − (a − c) × f
    slack = (8.0 * U * (abs(dx) + abs(dy)) + (x.size + 16) * U * mean) * force
    h, h_error = slip_margin(loads, mu, fx, fy, grip)
    if h < 0.0:
        return LimitAnswer(TRANSLATING, nan, nan, nan, nan, nan)
    if h == 0.0:
        return LimitAnswer(TRANSLATING, shift, shift - slack, shift + slack, nan, nan)
    if mean == 0.0:
        return LimitAnswer(HINGE, shift, shift - slack, shift + slack, frame.cx + frame.ex, frame.cy + frame.ey)
    start = Twist(disc_lean(1.0 - h) * (1.0 - h) / math.sqrt(h * (2.0 - h)), 0.0, 1.0)
    found, q, hinge = minimise(x, y, frame, taxels, start, Plane(h, h_error, 1.0, 0.0, False), stop)
    unit = grip * mean
    lower, upper = unit * found.lower + shift, unit * found.upper + shift
    slack += 8.0 * U * (abs(lower) + abs(upper))
    value = unit * found.value + shift
    if hinge >= 0:
        return LimitAnswer(HINGE, value, lower - slack, upper + slack, x[hinge], y[hinge])
    px = frame.cx + (frame.ex - mean * (frame.ct * q.vy + frame.st * q.vx))
    py = frame.cy + (frame.ey + mean * (frame.ct * q.vx - frame.st * q.vy))
    return LimitAnswer(INTERIOR, value, lower - slack, upper + slack, px, py)


@compiled_part
def unit_gauge(
    x: Array, y: Array, frame: Frame, taxels: Array, start: Twist, f: float, s: float, stop: Stop
) -> tuple[Bracket, Twist, int]:
    """Find the gauge of the load (f, 0, s) in the contact's own units.

    Args:
        x: Taxel centres as given, shape (n,), m.
        y: Likewise.
        frame: The contact's own units.
        taxels: The contact in these units, shape (3, n).
        start: A twist to start from; NaN where there is none.
        f: Force.
        s: Spin.
        stop: When to stop.

    Returns:
        The bounds and value of the gauge; the optimal twist; the index of the taxel that is a hinge (−1: none).
    """
    size = math.hypot(f, s)
    lx, lm = f / size, s / size
    power, length = lx * start.vx + lm * start.omega, abs(start.vx) + abs(start.vy) + abs(start.omega)
    if 0.0 < length <= ASKEW * power < math.inf:  # false where there is no number
        q = Twist(start.vx / power, start.vy / power, start.omega / power)
    else:
        lean = disc_lean(lx)
        power = lean * lx * lx + lm * lm
        q = Twist(lean * lx / power, 0.0, lm / power)
    found, q, hinge = minimise(x, y, frame, taxels, q, Plane(1.0, 0.0, -lm, lx, True), stop)
    lower, upper = size * found.lower * (1.0 - 8.0 * U), size * found.upper * (1.0 + 8.0 * U)
    return Bracket(lower, upper, size * found.value), q, hinge


@compiled
def solve_utilisation(
    x: Array, y: Array, loads: Array, mu: float, fx: float, fy: float, spin: float, ax: float, ay: float, vx: float,
    vy: float, omega: float, gap: float, passes: int,
) -> tuple[int, float, float, float, float, float, float, float, float]:  # fmt: skip
    """Find the utilisation, as the numbers of a `UtilisationAnswer`; (vx, vy, omega) is a start, or NaN."""
    load, start = Load(fx, fy, spin, ax, ay), Twist(vx, vy, omega)
    a = utilisation_of(x, y, loads, mu, load, start, Stop(gap, passes), np.empty((3, x.size)))
    return a.kind, a.value, a.lower, a.upper, a.pole_x, a.pole_y, a.vx, a.vy, a.omega


@compiled_part
def utilisation_of(
    x: Array, y: Array, loads: Array, mu: float, load: Load, start: Twist, stop: Stop, taxels: Array
) -> UtilisationAnswer:
    """Find the gauge λ of the limit surface for a load.

    Args:
        x: Taxel centres, shape (n,), m.
        y: Likewise.
        loads: Normal forces, shape (n,), N.
        mu: Coefficient of friction.
        load: What friction has to carry.
        start: A twist about the load's point to start from; NaN where there is none.
        stop: When to stop.
        taxels: Working memory, shape (3, n).

    Source: 1/λ = min D(q) over ℓ·q = 1; the limit surface generalises paper eqs. (4) to (7).
    """
    nan, inf = math.nan, math.inf
    fx, fy, m = load.fx, load.fy, load.spin
    frame = normalise(x, y, loads, fx, fy, taxels)
    total, mean = frame.total, frame.mean
    if math.isnan(total) or not math.isfinite(fx + fy + m + load.ax + load.ay):
        return UtilisationAnswer(NONE, nan, nan, nan, nan, nan, nan, nan, nan)
    force = math.hypot(fx, fy)
    if force == 0.0 and m == 0.0:
        return UtilisationAnswer(NONE, 0.0, 0.0, 0.0, nan, nan, nan, nan, nan)
    if total == 0.0:
        return UtilisationAnswer(NONE, inf, inf, inf, nan, nan, nan, nan, nan)
    grip = mu * total
    ct, st = frame.ct, frame.st
    dx, dy = (load.ax - frame.cx) - frame.ex, (load.ay - frame.cy) - frame.ey
    spin = m + (dx * fy - dy * fx)  # about the load centroid
    if mean == 0.0:
        if spin != 0.0:
            turn = math.copysign(1.0, spin)
            px, py = frame.cx + frame.ex, frame.cy + frame.ey
            return UtilisationAnswer(HINGE, inf, inf, inf, px, py, -turn * dy, turn * dx, turn)
        ratio = force / grip
        low, high = ratio * (1.0 - 8.0 * U), ratio * (1.0 + 8.0 * U)
        return UtilisationAnswer(TRANSLATING, ratio, low, high, nan, nan, ct, st, 0.0)
    vx, vy = (start.vx + start.omega * dy) / mean, (start.vy - start.omega * dx) / mean  # of the load centroid
    q = Twist(ct * vx + st * vy, ct * vy - st * vx, start.omega)
    found, q, hinge = unit_gauge(x, y, frame, taxels, q, force / grip, spin / (grip * mean), stop)
    # Turning about the load centroid carries what rounding adds to the spin, with twice the friction at most.
    slack = 16.0 * U * ((abs(dx) + abs(dy)) * force + abs(m)) / (grip * mean) + 2.0 * (x.size + 16) * U * force / grip
    value, lower, upper = found.value, max(found.lower - slack, 0.0), found.upper + slack
    vx, vy, om = mean * (ct * q.vx - st * q.vy), mean * (st * q.vx + ct * q.vy), q.omega  # of the load centroid
    ux, uy = vx - om * dy, vy + om * dx
    if abs(om) * FAR <= math.sqrt(q.vx**2 + q.vy**2):
        return UtilisationAnswer(TRANSLATING, value, lower, upper, nan, nan, ux, uy, om)
    if hinge >= 0:
        return UtilisationAnswer(HINGE, value, lower, upper, x[hinge], y[hinge], ux, uy, om)
    px, py = frame.cx + (frame.ex - vy / om), frame.cy + (frame.ey + vx / om)
    return UtilisationAnswer(INTERIOR, value, lower, upper, px, py, ux, uy, om)
