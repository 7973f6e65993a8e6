"""Newtons, metres and metres a second as the bytes of a Robotiq 2F gripper, by tables from the config.

The maker publishes the ends of these scales but no curve between them: a site measures its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from slipd.devices.force_map import ForceMap, interpolate

Table = Sequence[tuple[float, float]]

FULL = 255
"""The bytes of position, speed and force end here; position 0 is open."""

FORCE_TABLE: Table = ((0, 20.0), (FULL, 235.0))
WIDTH_TABLE: Table = ((0.0, 0.085), (1.0, 0.0))
SPEED_TABLE: Table = ((0, 0.020), (FULL, 0.150))
"""The ends that the 2F-85's sheet names, and straight lines between them for want of better."""

MIDDLE_SPEED = 128
"""Where no speed is asked for."""

_ROUNDING_M = 1e-6
"""What arithmetic does to a width or a speed at the end of its range; a position byte is 300 times as much."""


class Units:
    """Between SI units and the gripper's bytes.

    Args:
        force_table: (force byte, N on one pad), both rising.
        width_table: (position byte / 255, m between the pads), the first rising and the second falling.
        speed_table: (speed byte, m/s), both rising; None where no speed can be asked for.

    Attributes:
        force_range_n: Least and largest force, N on one pad.
        width_range_m: Least and largest width.
        speed_range_mps: Least and largest speed; None where none can be asked for.
    """

    def __init__(self, force_table: Table, width_table: Table, speed_table: Table | None) -> None:
        self._forces = ForceMap(force_table)
        self._widths = list(width_table)
        self._closures = [(width, closure) for closure, width in reversed(self._widths)]
        self._speeds = None if speed_table is None else [(speed, byte) for byte, speed in speed_table]
        self.force_range_n = (float(force_table[0][1]), float(force_table[-1][1]))
        self.width_range_m = (self._closures[0][0], self._closures[-1][0])
        self.speed_range_mps = None if self._speeds is None else (self._speeds[0][0], self._speeds[-1][0])

    def force(self, force_n: float) -> int:
        """Return the largest force byte that gives no more than ``force_n``; the least byte where all give more.

        Raises:
            ValueError: It is no number.
        """
        if not math.isfinite(force_n):
            raise ValueError(f"a force must be finite, got {force_n} N")
        return self._forces.units(force_n)

    def newtons(self, byte: int) -> float:
        """Return what a force byte gives, N on one pad."""
        return self._forces.newtons(byte)

    def position(self, width_m: float) -> int:
        """Return the position byte nearest to a width.

        Raises:
            ValueError: The gripper has no such width.
        """
        _check("the width", "m", width_m, self.width_range_m)
        return round(FULL * interpolate(self._closures, width_m))

    def width_m(self, position: int) -> float:
        """Return the width between the pads at a position byte."""
        return interpolate(self._widths, position / FULL)

    def speed(self, speed_mps: float | None) -> int:
        """Return the speed byte nearest to a speed; the middle one for None.

        Raises:
            ValueError: The gripper has no such speed, or none can be asked for.
        """
        if speed_mps is None:
            return MIDDLE_SPEED
        if self._speeds is None or self.speed_range_mps is None:
            raise ValueError("there is no speed_table: leave the speed out")
        _check("the speed", "m/s", speed_mps, self.speed_range_mps)
        return round(interpolate(self._speeds, speed_mps))


def _check(what: str, unit: str, value: float, bounds: tuple[float, float]) -> None:
    low, high = bounds
    if not low - _ROUNDING_M <= value <= high + _ROUNDING_M:  # also where it is no number
        raise ValueError(f"{what} must be from {low:g} to {high:g} {unit}, got {value}")
