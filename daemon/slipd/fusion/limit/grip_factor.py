"""The least factor on all loads that holds a load with a contact that grows as it is pressed."""

from __future__ import annotations

import math

import numpy as np

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.limit.frame import Frame, normalise
from slipd.fusion.limit.solve import GOAL, MAX_PASSES, Stop, unit_gauge
from slipd.fusion.limit.sweep import Twist
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
