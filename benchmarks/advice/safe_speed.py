"""The fastest safe motion, by the true values of a grasp."""

from __future__ import annotations

import math

import numpy as np

from slipd.tools.sim.carry import Move
from slipd.tools.sim.scene_parts import GRAVITY_MPS2


def holds_scale(move: Move, mass_kg: float, grip_n: float, mu: float) -> float:
    """Return the largest scale at which friction holds a move, by the true values: the fastest safe motion."""
    limit_n = 2.0 * mu * grip_n
    times = np.linspace(0.0, move.takes_s, 201)
    full = np.array([move.acceleration(float(t_s), 1.0) for t_s in times])

    def holds(scale: float) -> bool:
        x, z = (full * scale**2).T
        return bool((mass_kg * np.hypot(GRAVITY_MPS2 + z, x)).max() <= limit_n)

    if holds(1.0):
        return 1.0
    low, high = 0.0, 1.0
    while high - low > 1e-4:
        middle = math.fsum((low, high)) / 2.0
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
