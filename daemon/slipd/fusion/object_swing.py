"""How a held object swings about the line through both pads, on their soft surfaces.

An object whose centre of mass is aside turns a little in the grip until the shear of the pads carries it. The spin on
the pads therefore follows the spin that a rigid grip would carry as a lightly damped oscillator does, and goes beyond
it where a motion builds up within about a period.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.fusion.compiled import compiled, compiled_part
from slipd.types.arrays import Array

DAMPING = 0.03
"""Damping of the swing, as a part of the critical one: that of silicone with a loss factor of 0.06. Pads that damp more
swing less than predicted."""
RATES_RADPS = 2.0 * math.pi * np.geomspace(3.0, 14.0, 24)
"""Frequencies that a swing may have. A slower one is a slip rather than a swing; a faster one hardly shows."""
FOLLOW = 0.2
"""Part of the difference by which each frequency follows the measured spin in a reading."""
KEEP = 0.98
"""Part of the sums that each reading keeps: 50 readings count."""


@compiled_part
def swing_step(
    spin: float, rate: float, before: float, after: float, passed_s: float, omega: float
) -> tuple[float, float]:
    """Return the spin and its rate after a time in which the spin of a rigid grip goes evenly to another value.

    Args:
        spin: Spin at the begin.
        rate: Its rate.
        before: Spin of a rigid grip at the begin.
        after: Likewise at the end.
        passed_s: The time, s.
        omega: Frequency of the swing without damping, rad/s.

    Source: exact solution of the damped oscillator under a ramp.
    """
    slope, decay = (after - before) / passed_s, DAMPING * omega
    lag, fast = 2.0 * DAMPING / omega * slope, omega * math.sqrt(1.0 - DAMPING * DAMPING)
    fade = math.exp(-decay * passed_s)
    cos, sin = fade * math.cos(fast * passed_s), fade * math.sin(fast * passed_s) / fast
    off, turn = spin - before + lag, rate - slope
    return (
        after - lag + off * cos + (turn + decay * off) * sin,
        slope + turn * cos - (decay * turn + omega * omega * off) * sin,
    )


@compiled
def swing_excess(times_s: Array, rigid: Array, omega: float, swings: float, out: Array) -> None:
    """Find by how much the spin goes beyond that of a rigid grip in a motion.

    A swing from before the motion may be in any phase, so both amplitudes add as squares, in the direction of the spin.
    After the last point the object swings on: there the same holds for the whole swing.

    Args:
        times_s: Times of the points, shape (n,).
        rigid: Spin of a rigid grip at each.
        omega: Frequency of the swing, rad/s.
        swings: Amplitude of the swing from before.
        out: Filled with what that adds, and with the swing of the motion, shape (2, n).
    """
    spin, rate, last = rigid[0], 0.0, rigid.size - 1
    for k in range(rigid.size):
        if k > 0:
            spin, rate = swing_step(spin, rate, rigid[k - 1], rigid[k], times_s[k] - times_s[k - 1], omega)
        beyond, fade = spin - rigid[k], math.exp(-DAMPING * omega * (times_s[k] - times_s[0]))
        own = math.hypot(beyond, rate / omega)
        out[0, k] = math.copysign(math.hypot(own, fade * swings) - own, rigid[k])
        out[1, k] = beyond if k < last else math.copysign(own, rigid[k])


@compiled
def follow_swing(swings: Array, omegas: Array, before: float, after: float, passed_s: float, spin: float) -> int:
    """Let a swing of each frequency follow a measured spin; return the frequency that predicts it best.

    Args:
        swings: Spin, rate and sum of squared errors of each, shape (3, k).
        omegas: Frequencies, shape (k,), rad/s.
        before: As in `swing_step`.
        after: Likewise.
        passed_s: Likewise.
        spin: Measured at the end.
    """
    best = 0
    for k in range(omegas.size):
        expected, swings[1, k] = swing_step(swings[0, k], swings[1, k], before, after, passed_s, omegas[k])
        error = spin - expected
        swings[0, k] = expected + FOLLOW * error
        swings[2, k] = KEEP * swings[2, k] + error * error
        if swings[2, k] < swings[2, best]:
            best = k
    return best
