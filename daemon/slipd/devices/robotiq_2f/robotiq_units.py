"""Conversion between SI units and the bytes of a Robotiq 2F gripper, by tables from the config.

The manufacturer publishes only the ends of these scales, and they are not linear. So a site measures its own tables,
which are linear between their points.
"""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Sequence

from slipd.devices.shared.gripper_session import check_range

Table = Sequence[tuple[float, float]]

FULL = 255
"""Largest byte of position, speed and force."""

OPEN, CLOSED = 3, 230
"""Position bytes that a 2F-85 reports when it is fully open and fully closed.

Source: PickNikRobotics/ros2_robotiq_gripper at 3b6cf8f, ``robotiq_driver/src/hardware_interface.cpp``, lines 45 and 46.
The ROS 1 driver has 13 and 230 (ros-industrial-attic/robotiq at 1e744f1, ``robotiq_2f_gripper_ctrl.py``, ``get_pos``).
They depend on the fingertips, so a site measures its own.
"""

FORCE_TABLE: Table = ((0, 20.0), (FULL, 235.0))
WIDTH_TABLE: Table = ((OPEN / FULL, 0.085), (CLOSED / FULL, 0.0))
SPEED_TABLE: Table = ((0, 0.020), (FULL, 0.150))
"""Ends of the scales from the data sheet of the 2F-85, with straight lines between them."""

MIDDLE_SPEED = 128
"""Speed byte if no speed is requested."""

_ROUNDING = 1e-6
"""Rounding error allowed at the ends of the range, m or m/s; a position byte is 300 times as much."""


class Units:
    """Convert between SI units and the gripper's bytes.

    Args:
        force_table: (force byte, N on one pad), both rising.
        width_table: (position byte / 255, m between the pads), the first rising and the second falling.
        speed_table: (speed byte, m/s), both rising; None if the speed cannot be set.

    Attributes:
        force_range_n: Smallest and largest force, N on one pad.
        width_range_m: Smallest and largest width.
        width_step_m: Largest difference of the widths of two neighbouring position bytes.
        speed_range_mps: Smallest and largest speed; None if the speed cannot be set.
    """

    def __init__(self, force_table: Table, width_table: Table, speed_table: Table | None) -> None:
        self._forces = ForceMap(force_table)
        self._widths = list(width_table)
        self._closures = [(width, closure) for closure, width in reversed(self._widths)]
        slopes = [(wide - narrow) / (b - a) for (a, wide), (b, narrow) in itertools.pairwise(self._widths)]
        self.width_step_m = max(slopes) / FULL
        self._speeds = None if speed_table is None else [(speed, byte) for byte, speed in speed_table]
        self.force_range_n = (float(force_table[0][1]), float(force_table[-1][1]))
        self.width_range_m = (self._closures[0][0], self._closures[-1][0])
        self.speed_range_mps = None if self._speeds is None else (self._speeds[0][0], self._speeds[-1][0])

    def force(self, force_n: float) -> int:
        """Return the largest force byte that gives at most ``force_n``, or the smallest byte if all give more.

        Raises:
            ValueError: The force is not finite.
        """
        if not math.isfinite(force_n):
            raise ValueError(f"a force must be finite, got {force_n} N")
        return self._forces.units(force_n)

    def newtons(self, byte: int) -> float:
        """Return the force of a force byte, N on one pad."""
        return self._forces.newtons(byte)

    def position(self, width_m: float) -> int:
        """Return the position byte nearest to a width.

        Raises:
            ValueError: The width is out of range.
        """
        check_range("width", width_m, self.width_range_m, "m", _ROUNDING)
        return round(FULL * interpolate(self._closures, width_m))

    def width_m(self, position: int) -> float:
        """Return the width between the pads at a position byte."""
        return interpolate(self._widths, position / FULL)

    def speed(self, speed_mps: float | None) -> int:
        """Return the speed byte nearest to a speed, or the middle one for None.

        Raises:
            ValueError: The speed is out of range, or cannot be set.
        """
        if speed_mps is None:
            return MIDDLE_SPEED
        if self._speeds is None:
            raise ValueError("the speed must be left out, because there is no speed_table")
        check_range("speed", speed_mps, (self._speeds[0][0], self._speeds[-1][0]), "m/s", _ROUNDING)
        return round(interpolate(self._speeds, speed_mps))


class ForceMap:
    """Convert between device units and N on one pad by a table that rises in both columns.

    Args:
        table: (device units, N on one pad), at least two points, both columns strictly rising.
    """

    def __init__(self, table: Table) -> None:
        self._units = [float(units) for units, _ in table]
        self._newtons = [float(newtons) for _, newtons in table]

    def units(self, force_n: float) -> int:
        """Return the largest integer setting whose force does not exceed ``force_n``, or else the lowest setting."""
        exact = _interpolate(self._newtons, self._units, force_n)
        setting = int(exact + 1e-9)
        return max(setting, int(self._units[0]))

    def newtons(self, units: float) -> float:
        """Return the force of a setting, N on one pad."""
        return _interpolate(self._units, self._newtons, units)


def interpolate(table: Table, value: float) -> float:
    """Return the second column of a table at ``value`` of its rising first column, constant beyond its ends."""
    return _interpolate([float(a) for a, _ in table], [float(b) for _, b in table], value)


def _interpolate(xs: list[float], ys: list[float], x: float) -> float:
    if x <= xs[0]:
        return ys[0]
    if x >= xs[-1]:
        return ys[-1]
    k = bisect.bisect_right(xs, x)
    fraction = (x - xs[k - 1]) / (xs[k] - xs[k - 1])
    return ys[k - 1] + fraction * (ys[k] - ys[k - 1])
