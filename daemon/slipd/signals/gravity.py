"""The weight of the finger beyond its force sensor, taken out of the readings where its direction is known.

Who moves the arm tells the apparent gravity in the pad frame: gravity less the finger's own acceleration. Where nobody
tells, what the weight may do is an uncertainty, not an error that nobody sees.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slipd.signals.averaging import flushed

Array = NDArray[np.float64]

STANDARD_GRAVITY_MPS2 = 9.80665
#: An arm that accelerates its gripper by more than this has hit something, or the vector has another unit.
MOST_GRAVITY_MPS2 = 5.0 * STANDARD_GRAVITY_MPS2
#: An orientation older than this is not the present one. A stream of 10 Hz may lose one message; a wrist that turns at
#: 1 rad/s changes the weight by a quarter of itself meanwhile.
FRESH_NS = 250_000_000


def gravity_fault(gravity_mps2: object) -> str | None:
    """Says what is wrong with a gravity vector that someone sent; None where it may be set."""
    if not isinstance(gravity_mps2, (list, tuple)) or len(gravity_mps2) != 3:
        return "gravity_mps2 must be a list of three numbers, m/s² in the pad frame"
    if not all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in gravity_mps2):
        return "gravity_mps2 must hold numbers"
    within = all(abs(value) <= MOST_GRAVITY_MPS2 for value in gravity_mps2)  # false for NaN too
    if not (within and math.hypot(*gravity_mps2) <= MOST_GRAVITY_MPS2):
        return f"gravity_mps2 must be finite and at most {MOST_GRAVITY_MPS2:.1f} m/s² (5 g) long"
    return None


@dataclass(frozen=True, slots=True)
class FingerWeight:
    """What hangs beyond the sensor.

    Attributes:
        mass_kg: Its mass, kg; 0: nothing to compensate.
        com_m: Its centre of mass in the pad frame, m.

    Raises:
        ValueError: A negative mass, or a value that is not finite.
    """

    mass_kg: float = 0.0
    com_m: Sequence[float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not 0.0 <= self.mass_kg < math.inf:
            raise ValueError(f"mass_kg must be 0 or more and finite, not {self.mass_kg}")
        if len(self.com_m) != 3 or not all(map(math.isfinite, self.com_m)):
            raise ValueError(f"com_m must be three finite numbers, not {self.com_m}")

    def wrench(self, gravity_mps2: Array | Sequence[float]) -> Array:
        """What the weight adds to the force on the finger: F = m g, M = c × m g.

        Args:
            gravity_mps2: Apparent gravity in the pad frame (gravity less the finger's acceleration), shape (3,), m/s².

        Returns:
            Force (3,), N, and torque about the pad's origin (3,), N·m, in one array (6,). The wrench of the object is
            the mounted reading less this.
        """
        x, y, z = self.com_m
        fx, fy, fz = (self.mass_kg * float(component) for component in gravity_mps2)
        return flushed(np.array((fx, fy, fz, y * fz - z * fy, z * fx - x * fz, x * fy - y * fx)))


class GravityCompensation:
    """What is to be subtracted from a finger's mounted readings for its weight, and what may be left of it.

    A tare takes the weight at its own pose into its offset. Known there, only the difference to it is subtracted;
    unknown, nothing is, until the finger is tared again under a known gravity. An orientation that grew old is held:
    that is no worse than to drop it, and moves nothing at a standstill.

    Args:
        weight: The part beyond the sensor.

    Attributes:
        correction: Force and torque in the pad frame to be subtracted, shape (6,), not to be written to; None where
            there is nothing to subtract.
    """

    def __init__(self, weight: FingerWeight) -> None:
        self.correction: Array | None = None
        self._weight = weight
        self._lever_m = math.hypot(*weight.com_m)
        self._gravity: Array | None = None
        self._in_offset: Array | None = np.zeros(3)
        self._fresh_until_ns: int | None = None
        self._unknown = self._bounds(0.0)

    def set(self, gravity_mps2: Sequence[float], t_ns: int) -> None:
        """Takes the apparent gravity in the pad frame at ``t_ns``, m/s².

        Raises:
            ValueError: `gravity_fault` has something to say against it.
        """
        fault = gravity_fault(gravity_mps2)
        if fault is not None:
            raise ValueError(fault)
        self._gravity = np.array(gravity_mps2, dtype=np.float64)
        self._fresh_until_ns = t_ns + FRESH_NS
        self._correct()

    def forget(self) -> None:
        """Time passed that no clock counted: the orientation is not fresh any more."""
        self._fresh_until_ns = None

    def retare(self, gravity_mps2: Array | None) -> None:
        """Another offset came into force, by a tare or its undo.

        Args:
            gravity_mps2: Apparent gravity whose weight is part of that offset (`Offset.gravity_mps2`).
        """
        self._in_offset = gravity_mps2
        self._correct()

    def gravity(self, t_ns: int) -> Array | None:
        """Apparent gravity in the pad frame, shape (3,), m/s²; None where it is not known at ``t_ns``."""
        return self._gravity if self._is_fresh(t_ns) else None

    def uncertainty(self, t_ns: int) -> tuple[float, float]:
        """Most that the weight may add to a corrected reading at ``t_ns``: N and N·m; zeros where it is compensated.

        For an arm that does not accelerate: gravity is somewhere on its sphere. After a tare that is 2 m g, with the
        distance of the centre of mass as its lever.
        """
        if self.correction is not None and self._is_fresh(t_ns):
            return 0.0, 0.0
        return self._unknown

    def state(self, t_ns: int) -> str:
        """Tells "none" (no weight), "compensated" or "unknown_orientation"."""
        if self._weight.mass_kg == 0.0:
            return "none"
        return "compensated" if self.correction is not None and self._is_fresh(t_ns) else "unknown_orientation"

    def _is_fresh(self, t_ns: int) -> bool:
        return self._fresh_until_ns is not None and t_ns <= self._fresh_until_ns

    def _correct(self) -> None:
        """The correction, and what stays where gravity g is unknown: m (g − r), r what the reading is zero at."""
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
