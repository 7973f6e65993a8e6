"""Compare a force/torque reading with the one before and with the range of the sensor."""

from __future__ import annotations

import math
from collections.abc import Sequence

from slipd.fusion.compiled import compiled
from slipd.types.arrays import Array

REPEATS, JUMPS, IMPOSSIBLE, NOT_FINITE = 1, 2, 4, 8
"""Findings about a reading, which `compare` adds up."""


@compiled
def compare(before: Sequence[float], row: Sequence[float], range_n: float, range_nm: float, jump_n: float) -> int:
    """Return the sum of the findings about a reading; 0 if it is in range, and differs from the last, by no jump.

    Args:
        before: Force and torque of the reading before; NaN if there is none.
        row: Force and torque of the reading.
        range_n: Largest possible force; NaN is impossible too.
        range_nm: Largest possible torque; NaN is only not finite.
        jump_n: Smallest change of the force that is a jump; a change from or to NaN is none.
    """
    repeats = finite = True
    for i in range(6):
        repeats = repeats and row[i] == before[i]
        finite = finite and math.isfinite(row[i])
    findings = 0
    if repeats:
        findings += REPEATS
    if not finite:
        findings += NOT_FINITE
    if math.hypot(math.hypot(row[0] - before[0], row[1] - before[1]), row[2] - before[2]) >= jump_n:
        findings += JUMPS
    force_is_possible = math.hypot(math.hypot(row[0], row[1]), row[2]) <= range_n
    if not force_is_possible or math.hypot(math.hypot(row[3], row[4]), row[5]) > range_nm:
        findings += IMPOSSIBLE
    return findings


@compiled
def any_finding(before: Sequence[float], rows: Array, range_n: float, range_nm: float, jump_n: float) -> bool:
    """Return whether `compare` finds anything about one of several readings."""
    if compare(before, rows[0], range_n, range_nm, jump_n):
        return True
    for k in range(1, len(rows)):  # noqa: SIM110 - Numba knows no generators
        if compare(rows[k - 1], rows[k], range_n, range_nm, jump_n):
            return True
    return False
