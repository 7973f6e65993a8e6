"""The least factor on all loads that holds a load with a contact that grows as it is pressed, and its torque limit."""

from __future__ import annotations

import math

import numpy as np

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.limit.frame import Frame, Load, normalise
from slipd.fusion.limit.solve import GOAL, MAX_PASSES, Stop, torque_limit_of, unit_gauge
from slipd.fusion.limit.sweep import Twist
from slipd.fusion.load_noise import relative_noise
from slipd.types.arrays import Array

MAX_ROOT_STEPS = 60  # of a bracketed Newton that takes 3–5
ROOT = 1e-12  # precision of log k


@compiled_part
def grown_gauge(x: Array, y: Array, frame: Frame, taxels: Array, f: float, s: float, growth: float) -> float:
    """Find the k with gauge(f, s / k^growth) = k: bracketed Newton on log k, each solve from the twist of the last.

    The slope of log gauge is the share of the power that the spin takes, times −growth.
    """
    q = Twist(math.nan, math.nan, math.nan)
    low, high, log_k, upper = -math.inf, math.inf, 0.0, 0.0
    for _ in range(MAX_ROOT_STEPS):
        spin = s * math.exp(-growth * log_k)
        found, q, _ = unit_gauge(x, y, frame, taxels, q, f, spin, Stop(GOAL, MAX_PASSES))
        upper = found.upper
        if growth == 0.0:
            return upper
        missing = math.log(found.value) - log_k
        if abs(missing) <= ROOT or not high - low > ROOT:
            break
        if missing > 0.0:
            low = log_k
        else:
            high = log_k
        share = spin * q.omega / math.hypot(f, spin)  # ℓ·q = 1
        step = log_k + missing / (1.0 + growth * share)
        if not low < step < high:
            step = 0.5 * (low + high) if math.isfinite(high - low) else log_k + math.copysign(1.0, missing)
        log_k = step
    return max(upper, math.exp(log_k))


@compiled
def solve_grip_factor(
    x: Array, y: Array, loads: Array, mu: float, fx: float, fy: float, spin: float, ax: float, ay: float, growth: float
) -> float:
    """Find the least factor k on all loads that holds a load where the contact grows by k^growth about its centroid."""
    taxels = np.empty((3, x.size))
    frame = normalise(x, y, loads, fx, fy, taxels)
    if math.isnan(frame.total) or not math.isfinite(fx + fy + spin + ax + ay):
        return math.nan
    force = math.hypot(fx, fy)
    if force == 0.0 and spin == 0.0:
        return 0.0
    if frame.total == 0.0:
        return math.inf
    grip = mu * frame.total
    own_spin = spin + (((ax - frame.cx) - frame.ex) * fy - ((ay - frame.cy) - frame.ey) * fx)
    if frame.mean == 0.0:  # a point has no size that could grow
        return force / grip if own_spin == 0.0 else math.inf
    return grown_gauge(x, y, frame, taxels, force / grip, own_spin / (grip * frame.mean), growth)


@compiled_part
def solve_reserve(
    x: Array, y: Array, loads: Array, mu: float, fx: float, fy: float, spin: float, ax: float, ay: float,
    twist: tuple[float, float, float], force_std: float, torque_std: float, stds: float, safety: float,
    spin_scale: float, growth: float,
) -> tuple[float, float]:  # fmt: skip
    """Find how much of a contact's load is needed, and which torque it carries beside its tangential force.

    Args:
        x: Taxel centres, shape (n,), m.
        y: Likewise.
        loads: Normal forces, shape (n,), N.
        mu: Coefficient of friction.
        fx: Tangential force along X, N.
        fy: Likewise along Y.
        spin: Torque about the pad normal through (ax, ay), N·m.
        ax: Centroid of the contact along X, m.
        ay: Likewise along Y.
        twist: The motion that would begin, as in `relative_noise`.
        force_std: Standard deviation of each force component, N; 0 where it is not known.
        torque_std: Standard deviation of each torque component, N·m; likewise.
        stds: The load counts with so many standard deviations more.
        safety: Factor on the load that has to be held.
        spin_scale: How many times as much friction a spin uses.
        growth: Exponent with which the contact grows, see `solve_grip_factor`.

    Returns:
        The least factor on all loads that holds the load with its safety, and the largest torque in the sense of the
        spin, N·m.
    """
    held = safety * (1.0 + stds * relative_noise((fx, fy), spin, (ax, ay), twist, force_std, torque_std))
    factor = solve_grip_factor(x, y, loads, mu, held * fx, held * fy, held * (spin * spin_scale), ax, ay, growth)
    sense, load = 1 if spin >= 0.0 else -1, Load(fx, fy, 0.0, ax, ay)
    limit = torque_limit_of(x, y, loads, mu, load, sense, Stop(GOAL, MAX_PASSES), np.empty((3, x.size)))
    return factor, limit.torque / spin_scale
