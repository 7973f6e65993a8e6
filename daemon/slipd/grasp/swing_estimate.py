"""The frequency at which the held object swings on the pads, as it has shown in this grasp."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slipd.fusion.object_swing import KEEP, RATES_RADPS, follow_swing, swing_excess
from slipd.types.arrays import Array

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
