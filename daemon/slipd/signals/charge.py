"""Force from the charge of a piezoelectric taxel.

A PVDF element gives charge only while its force changes. Behind a charge amplifier with leak τ the output y obeys
y' = f' − y/τ, so f = y + (1/τ) ∫ y dt, and every offset of y integrates into drift. What keeps it honest: without
contact the force is zero, which resets the integral and shows the offset. What leaked away under a held load is missing
when it ends: the output then lies below the offset by as much, and comes back within some τ.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Time constant of learning the offset without contact, s: long against the noise, short against warming.
OFFSET_TAU_S = 0.5
#: A longer gap than this many leak times leaves nothing of the charge: the integral cannot be carried over it.
LONGEST_GAP_TAUS = 0.1


class ChargeReconstruction:
    """Reconstructs the forces of one pad, in the unit of its readings.

    Args:
        taxels: Number of taxels.
        tau_s: Leak time constant of the charge amplifiers, s.
    """

    def __init__(self, taxels: int, tau_s: float) -> None:
        if not 0.0 < tau_s < math.inf:
            raise ValueError(f"tau_s must be positive and finite, not {tau_s}")
        self._tau_s = tau_s
        self._offset: Array | None = None
        self._integral = np.zeros(taxels)
        self._last = np.zeros(taxels)
        self._last_s: float | None = None
        self._resting = True

    @property
    def ready(self) -> bool:
        """The offset was seen without contact, and no gap lost the charge since."""
        return self._offset is not None and self._last_s is not None

    def update(self, readings: Array, t_s: float, known_free: bool) -> Array:
        """Takes one scan.

        Args:
            readings: Amplifier outputs, shape (taxels,).
            t_s: Time of the scan, s, rising.
            known_free: The force sensor reads no contact; anything else may be a held load, which is never erased.

        Returns:
            Force on each taxel, shape (taxels,), in the unit of the readings; zeros where free; NaN where a contact
            cannot be known because none of its beginning was seen, or a reading is no number.
        """
        if not np.isfinite(readings).all():
            self.forget()
            return np.full_like(readings, math.nan)
        if known_free:
            self._rest(readings, t_s)
            return np.zeros_like(readings)
        self._resting = False
        if self._offset is None or self._last_s is None or t_s - self._last_s > LONGEST_GAP_TAUS * self._tau_s:
            self._last_s = None
            return np.full_like(readings, math.nan)
        charge = readings - self._offset
        self._integral += 0.5 * (charge + self._last) * ((t_s - self._last_s) / self._tau_s)
        self._last, self._last_s = charge, t_s
        return charge + self._integral

    def forget(self) -> None:
        """Gives up the charge: time passed that was not seen. The offset stays."""
        self._resting = False
        self._last_s = None

    def _rest(self, readings: Array, t_s: float) -> None:
        if self._offset is None:
            self._offset = readings.copy()
        elif not self._resting:
            self._integral = self._offset - readings
        elif self._last_s is not None:
            elapsed_s = t_s - self._last_s
            self._integral *= math.exp(-elapsed_s / self._tau_s)
            share = -math.expm1(-elapsed_s / OFFSET_TAU_S)
            self._offset = self._offset + share * (readings + self._integral - self._offset)
        self._resting = True
        self._last, self._last_s = readings - self._offset, t_s
