"""Force from the charge of a piezoelectric taxel.

A PVDF element gives charge only while its force changes. Behind a charge amplifier with leak τ the output y obeys
y' = f' − y/τ, so f = y + (1/τ) ∫ y dt, and every offset of y integrates into drift. Three corrections bound it:

* Without contact the force is zero, which resets the integral and shows the offset. The charge that leaked away under a
  held load is missing when the load ends: the output then lies below the offset by that much and recovers in a few τ.
* PVDF is also pyroelectric, so warming adds a charge that all taxels share. During a contact the taxels outside it show
  that charge, and whatever else they accumulate is forgotten.
* The force sensor measures the normal force on the whole pad: a sum that creeps away from it is drift.

None of them erases a held load. The first waits until the force sensor reads no contact, the second forgets only what
is negligible beside the load, and the third removes only what the force sensor does not measure.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.fusion.compiled import compiled
from slipd.fusion.ranked import ranked
from slipd.types.arrays import Array

OFFSET_TAU_S = 0.5
"""Time constant of learning the offset without contact, s: long compared to noise, short compared to warming."""
PEAK_RANK = 3
"""The third largest reading stands for the largest: one or two hot taxels must not make the others look unloaded. A
contact of one or two taxels is therefore neither corrected nor erased."""
LOADED_SHARE = 0.05
"""A taxel belongs to the contact while it reads more than this fraction of the largest reading."""
UNLOADED_SHARE, UNLOADED_TAXELS = 0.125, 8
"""The common charge needs at least this fraction of the pad, and this many taxels, outside the contact."""
COMMON_TAU_S = 1.0
"""Time constant of following the common charge, s: long compared to a press, short compared to warming."""
UNLOADED_TAU_S = 30.0
"""Time constant of forgetting what a taxel outside the contact accumulates, s: long compared to a creeping contact."""
ANCHOR_TAU_S = 5.0
"""Time constant of following the force sensor, s: a bias of it is reported long before it is followed."""
LONGEST_GAP_TAUS = 0.1
"""The integral cannot be carried over a gap longer than this many leak time constants."""
_NEVER_S = -math.inf


class ChargeReconstruction:
    """Reconstructs the forces of one pad, in the unit of its readings.

    Args:
        taxels: Number of taxels.
        tau_s: Leak time constant of the charge amplifiers, s.
    """

    def __init__(self, taxels: int, tau_s: float) -> None:
        self._tau_s = tau_s
        self._offset: Array | None = None
        self._integral = np.zeros(taxels)
        self._last = np.zeros(taxels)
        self._last_s = _NEVER_S
        self._resting = True
        self._common = 0.0

    def update(self, readings: Array, t_s: float, known_free: bool, anchor: float = math.nan) -> Array:
        """Update with one scan.

        Args:
            readings: Amplifier outputs, shape (taxels,).
            t_s: Time of the scan, s, rising.
            known_free: The force sensor measures no contact. Otherwise there may be a held load, which is never erased.
            anchor: Normal force on the whole pad, in the unit of the readings; NaN: not known. State it only for a
                calibrated pad, and only while it agrees with the force sensor.

        Returns:
            Force on each taxel, shape (taxels,), in the unit of the readings. Zeros if free; NaN if a reading is not
            finite, or if the beginning of the contact was not seen.
        """
        if not math.isfinite(float(readings.dot(readings))):
            self.forget()
            return np.full_like(readings, math.nan)
        if known_free:
            self._rest(readings, t_s)
            return np.zeros_like(readings)
        self._resting = False
        if self._offset is None or t_s - self._last_s > LONGEST_GAP_TAUS * self._tau_s:
            self._last_s = _NEVER_S
            return np.full_like(readings, math.nan)
        elapsed_s, self._last_s = t_s - self._last_s, t_s
        forces = np.empty_like(readings)
        self._common = _integrate(
            forces, self._integral, self._last, readings, self._offset, elapsed_s, self._tau_s, self._common, anchor
        )
        return forces

    def shift(self, by: Array) -> None:
        """Adapt to a moved zero: from now on readings are lower by ``by``, shape (taxels,)."""
        if self._offset is not None:
            self._offset = self._offset - by

    def forget(self) -> None:
        """Forget the charge after time that was not observed; keep the offset."""
        self._resting = False
        self._last_s = _NEVER_S

    def _rest(self, readings: Array, t_s: float) -> None:
        if self._offset is None:
            self._offset = readings.copy()
        elif not self._resting:
            self._integral = self._offset - readings
        else:
            elapsed_s = t_s - self._last_s
            self._integral *= math.exp(-elapsed_s / self._tau_s)
            share = -math.expm1(-elapsed_s / OFFSET_TAU_S)
            self._offset = self._offset + share * (readings + self._integral - self._offset)
        self._resting = True
        self._common = 0.0
        self._last, self._last_s = readings - self._offset, t_s


@compiled
def _integrate(
    forces: Array, integral: Array, last: Array, readings: Array, offset: Array, elapsed_s: float, tau_s: float,
    common: float, anchor: float,
) -> float:  # fmt: skip
    """Integrate one scan and remove the drift.

    Args:
        forces: Filled with the force on each taxel.
        integral: Charge that leaked away; updated.
        last: Charge of the previous scan; updated.
        readings: The scan.
        offset: Offset of the readings.
        elapsed_s: Time since the previous scan, s.
        tau_s: Leak time constant, s.
        common: Charge that all taxels share.
        anchor: Normal force on the whole pad; NaN if not known.

    Returns:
        The common charge now.
    """
    count = len(readings)
    force, unloaded, rest = np.empty(count), np.empty(count, np.bool_), 0
    for k in range(count):
        charge = readings[k] - offset[k]
        integral[k] += 0.5 * (charge + last[k]) * (elapsed_s / tau_s)
        last[k] = charge
        force[k] = charge + integral[k]
    by_rank = force.copy()
    peak = max(ranked(by_rank, count - min(PEAK_RANK, count)) - common, 0.0)
    for k in range(count):
        unloaded[k] = not force[k] - common > LOADED_SHARE * peak
        rest += int(unloaded[k])
    if rest >= max(UNLOADED_TAXELS, UNLOADED_SHARE * count):
        middle = ranked(by_rank, rest // 2)  # the unloaded taxels are those that read least
        common -= math.expm1(-elapsed_s / COMMON_TAU_S) * (middle - common)
        for k in range(count):
            if unloaded[k]:
                integral[k] += math.expm1(-elapsed_s / UNLOADED_TAU_S) * (force[k] - common)
    total = 0.0
    for k in range(count):
        forces[k] = force[k] - common
        if not unloaded[k]:
            total += forces[k]
    if not math.isnan(anchor) and rest < count:
        surplus = (total - anchor) / (count - rest)
        for k in range(count):
            if not unloaded[k]:
                integral[k] += math.expm1(-elapsed_s / ANCHOR_TAU_S) * surplus
    return common
