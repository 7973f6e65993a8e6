"""Compensate the weight of the finger beyond its force sensor, if its direction is known.

The robot program sends the apparent gravity in the pad frame: gravity minus the acceleration of the finger. A stream of
the arm's motion gives it at any place of the gripper (`gravity_at`). Without either, the weight counts as an
uncertainty of the readings, not as a silent error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slipd.types.arrays import Array, cross_matrix, flushed
from slipd_client.quaternions import cross

STANDARD_GRAVITY_MPS2 = 9.80665
MOST_GRAVITY_MPS2 = 5.0 * STANDARD_GRAVITY_MPS2
"""Largest apparent gravity: a larger one means a collision or a wrong unit."""
FRESH_NS = 250_000_000
"""Time for which an orientation is valid. A stream of 10 Hz may lose one message; meanwhile a wrist that turns at 1
rad/s changes the weight components by a quarter of the weight."""


def gravity_fault(gravity_mps2: Sequence[float]) -> str | None:
    """Return what is wrong with a gravity vector from outside, shape (3,), or None."""
    if math.hypot(*gravity_mps2) <= MOST_GRAVITY_MPS2:  # false for NaN
        return None
    return f"gravity_mps2 must be finite, with a length of at most {MOST_GRAVITY_MPS2:.1f} m/s² (5 g)"


def gravity_at(
    place_m: Sequence[float],
    gravity_mps2: Sequence[float],
    velocity_radps: Sequence[float],
    acceleration_radps2: Sequence[float] | None,
) -> tuple[float, float, float]:
    """Return the apparent gravity at a place of a turning rigid body: g − α × r − ω × (ω × r), m/s².

    Args:
        place_m: Place r, from the origin, shape (3,), m.
        gravity_mps2: Apparent gravity at the origin, shape (3,), m/s².
        velocity_radps: Angular velocity ω, shape (3,), rad/s.
        acceleration_radps2: Angular acceleration α, shape (3,), rad/s²; None is taken as 0.
    """
    inward = cross(velocity_radps, cross(velocity_radps, place_m))
    along = (0.0, 0.0, 0.0) if acceleration_radps2 is None else cross(acceleration_radps2, place_m)
    x, y, z = (g - a - b for g, a, b in zip(gravity_mps2, along, inward, strict=True))
    return x, y, z


def gravities_at(place_m: Array, motions: Array) -> Array:
    """Return the result of `gravity_at` for several motions, shape (n, 3), m/s².

    Args:
        place_m: Place r, from the origin, shape (3,), m.
        motions: Apparent gravity at the origin, ω and α of each, shape (n, 9).
    """
    turning, crossed = motions[:, 3:6], cross_matrix(place_m)  # α @ crossed is α × r
    inward = turning * (turning @ place_m)[:, None] - np.outer((turning**2).sum(axis=1), place_m)
    found: Array = motions[:, :3] - motions[:, 6:9] @ crossed - inward
    return found


@dataclass(frozen=True, slots=True)
class FingerWeight:
    """Weight of the part beyond the sensor.

    Attributes:
        mass_kg: Mass, kg; 0: nothing to compensate.
        com_m: Centre of mass in the pad frame, m.
    """

    mass_kg: float = 0.0
    com_m: Sequence[float] = (0.0, 0.0, 0.0)

    def wrench(self, gravity_mps2: Array | Sequence[float]) -> Array:
        """Return the wrench of the weight on the finger: F = m g, M = c × m g.

        Args:
            gravity_mps2: Apparent gravity in the pad frame (gravity minus the acceleration), shape (3,), m/s².

        Returns:
            Force (3,), N, and torque about the pad's origin (3,), N·m, in one array (6,). The wrench of the object is
            the mounted reading minus this.
        """
        force_n = [self.mass_kg * float(component) for component in gravity_mps2]
        return flushed(np.array((*force_n, *cross(self.com_m, force_n))))


class GravityCompensation:
    """Weight correction of a finger's mounted readings, and the uncertainty that remains.

    A tare includes the weight at its own pose. If that pose is known, only the difference to it is corrected. If not,
    nothing is corrected until the finger is tared again with a known orientation. An orientation that is too old is
    kept: that is no worse than dropping it, and causes no step at standstill.

    Args:
        weight: The part beyond the sensor.

    Attributes:
        correction: Force and torque in the pad frame to subtract, shape (6,), read-only; None if there is nothing to
            subtract.
    """

    def __init__(self, weight: FingerWeight) -> None:
        self.correction: Array | None = None
        self._weight = weight
        self._lever_m = math.hypot(*weight.com_m)
        self._gravity: Array | None = None
        self._in_offset: Array | None = np.zeros(3)
        self._fresh_until_ns = -1  # nothing is known
        self._unknown = self._bounds(0.0)

    def set(self, gravity_mps2: Sequence[float], t_ns: int, fresh_ns: int = FRESH_NS) -> None:
        """Set the apparent gravity in the pad frame at ``t_ns``, m/s², which is valid for ``fresh_ns``.

        The caller has checked it; see `gravity_fault`.
        """
        self._gravity = np.array(gravity_mps2, dtype=np.float64)
        self._fresh_until_ns = t_ns + fresh_ns
        self._correct()

    def extend(self, until_ns: int) -> None:
        """Let an orientation that was not forgotten be valid until then, if it is not valid for longer."""
        if self._fresh_until_ns >= 0:
            self._fresh_until_ns = max(self._fresh_until_ns, until_ns)

    def forget(self) -> None:
        """Mark the orientation as old, because time passed that the clock did not count."""
        self._fresh_until_ns = -1

    def retare(self, gravity_mps2: Array | None) -> None:
        """Adapt to another offset, after a tare or its undo.

        Args:
            gravity_mps2: Apparent gravity at which that offset was taken (`Offset.gravity_mps2`).
        """
        self._in_offset = gravity_mps2
        self._correct()

    def gravity(self, t_ns: int) -> Array | None:
        """Return the apparent gravity in the pad frame, shape (3,), m/s²; None if not known at ``t_ns``."""
        return self._gravity if t_ns <= self._fresh_until_ns else None

    def uncertainty(self, t_ns: int) -> tuple[float, float]:
        """Return the largest effect of the weight on a corrected reading at ``t_ns``, N and N·m; zeros if compensated.

        It assumes an arm that does not accelerate, with gravity in any direction: 2 m g after a tare, with the distance
        of the centre of mass as lever.
        """
        if self.correction is not None and t_ns <= self._fresh_until_ns:
            return 0.0, 0.0
        return self._unknown

    def state(self, t_ns: int) -> str:
        """Return "none" (no weight), "compensated" or "unknown_orientation"."""
        if self._weight.mass_kg == 0.0:
            return "none"
        return "compensated" if self.correction is not None and t_ns <= self._fresh_until_ns else "unknown_orientation"

    def _correct(self) -> None:
        """Update the correction and the uncertainty for unknown g: m (g − r), where r is the gravity of the offset."""
        gravity, inside = self._gravity, self._in_offset
        self.correction = None
        if inside is None:
            self._unknown = self._bounds(STANDARD_GRAVITY_MPS2)
        elif gravity is None:
            self._unknown = self._bounds(math.hypot(*inside))
        else:
            self._unknown = self._bounds(math.hypot(*gravity))
            if self._weight.mass_kg > 0.0:
                self.correction = self._weight.wrench(gravity - inside)
                self.correction.flags.writeable = False

    def _bounds(self, zero_mps2: float) -> tuple[float, float]:
        force_n = self._weight.mass_kg * (STANDARD_GRAVITY_MPS2 + zero_mps2)
        return force_n, force_n * self._lever_m
