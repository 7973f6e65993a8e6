"""How a held object swings about the line through both pads, on their soft surfaces.

An object whose centre of mass is aside turns a little in the grip until the shear of the pads carries it. The spin on
the pads therefore follows the spin that a rigid grip would carry as a lightly damped oscillator does, and goes beyond
it where a motion builds up within about a period. Its frequency is learned from the readings of each grasp.
"""

from __future__ import annotations

import math
from typing import NamedTuple

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
MOST_GAP_NS = 60_000_000
"""A longer gap between readings restarts the estimate."""
LEAST_READINGS = 15
"""Readings that the estimate needs, some two periods of a swing."""
SEEN = 0.3
"""A swing is seen where a frequency leaves at most this part of the squares that a rigid grip leaves unexplained."""


class Swing(NamedTuple):
    """How the object swings.

    Attributes:
        rate_radps: Frequency without damping.
        spin_nm: Amplitude now of the spin on both pads together.
    """

    rate_radps: float
    spin_nm: float


class SwingEstimate:
    """Learns the frequency from how the spin departs from that of a rigid grip."""

    def __init__(self) -> None:
        self._seen: int | None = None
        self._swings = np.zeros((3, RATES_RADPS.size))
        self._rigid, self._t_ns = 0.0, 0
        self._squares, self._offset, self._count = 0.0, 0.0, 0

    def swing(self) -> Swing | None:
        """Return how the object swings; None: no swing was seen."""
        if self._seen is None:
            return None
        (spin, rate, _), rate_radps = self._swings[:, self._seen], float(RATES_RADPS[self._seen])
        return Swing(rate_radps, math.hypot(spin - self._rigid, rate / rate_radps))

    def update(self, t_ns: int, spin_nm: float, rigid_nm: float) -> None:
        """Follow the spin of both pads at ``t_ns``, which would be ``rigid_nm`` in a rigid grip; NaN: unknown."""
        if math.isnan(spin_nm):
            return
        passed_ns, before = t_ns - self._t_ns, self._rigid
        self._t_ns, self._rigid = t_ns, rigid_nm
        if not 0 < passed_ns <= MOST_GAP_NS:
            self._offset, self._squares, self._count = spin_nm - rigid_nm, 0.0, 0
            self._swings[0], self._swings[1:] = rigid_nm, 0.0
            return
        self._count += 1
        self._offset += (spin_nm - rigid_nm - self._offset) * max(1.0 / self._count, 1.0 - KEEP)
        spin_nm -= self._offset
        best = follow_swing(self._swings, RATES_RADPS, before, rigid_nm, passed_ns * 1e-9, spin_nm)
        self._squares = KEEP * self._squares + (spin_nm - rigid_nm) ** 2
        left = self._swings[2, best]
        if self._count >= LEAST_READINGS and 0 < best < RATES_RADPS.size - 1 and left < SEEN * self._squares:
            self._seen = best


def spin_about(middle_m: Array, axis: Array, load: Array) -> float:
    """Return the torque about a line along ``axis``, shape (3,), of a load about the origin, shape (6,)."""
    return float(axis @ (load[3:] - np.cross(middle_m, load[:3])))


def with_swing(
    swing: Swing, times_s: Array, spin: Array, mass_kg: float, axis: Array, rest: Array, rigid: Array
) -> tuple[Array, Array]:
    """Return rest and motion of a rigid grip with the swing of the object added.

    Args:
        swing: The swing.
        times_s: Times of the points, shape (n,).
        spin: Spin of a rigid grip at each with an object of 1 kg, along ``axis``.
        mass_kg: Mass of the object.
        axis: Direction of the line through both pads, shape (3,).
        rest: As of `slipd.fusion.motion_scale.check_points`, shape (n, 6).
        rigid: Its ``motion`` of a rigid grip, shape (n, 6).
    """
    excess, rest, swung = np.empty((2, spin.size)), rest.copy(), rigid.copy()
    swing_excess(times_s, spin, swing.rate_radps, swing.spin_nm / mass_kg, excess)
    rest[:, 3:] += np.outer(excess[0], axis)
    swung[:, 3:] += np.outer(excess[1], axis)
    return rest, swung


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
