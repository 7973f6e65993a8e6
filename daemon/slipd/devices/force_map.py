"""Between newtons on one pad and the units of a gripper, by a table from the config.

No maker publishes the map, and it is not linear; so it is the site's own measurement, linear between its points.
"""

from __future__ import annotations

import bisect
from collections.abc import Sequence


class ForceMap:
    """A rising table of (device units, N on one pad).

    Args:
        table: At least two points, both columns strictly rising.
    """

    def __init__(self, table: Sequence[tuple[float, float]]) -> None:
        self._units = [float(units) for units, _ in table]
        self._newtons = [float(newtons) for _, newtons in table]

    def units(self, force_n: float) -> int:
        """Largest whole device setting whose force does not exceed ``force_n`` (the lowest setting below the table)."""
        exact = _between(self._newtons, self._units, force_n)
        setting = int(exact + 1e-9)
        return max(setting, int(self._units[0]))

    def newtons(self, units: float) -> float:
        """Force that a device setting gives, N on one pad."""
        return _between(self._units, self._newtons, units)


def interpolate(table: Sequence[tuple[float, float]], value: float) -> float:
    """Second column of a table at ``value`` of its rising first, held at its ends."""
    return _between([float(a) for a, _ in table], [float(b) for _, b in table], value)


def _between(xs: list[float], ys: list[float], x: float) -> float:
    if x <= xs[0]:
        return ys[0]
    if x >= xs[-1]:
        return ys[-1]
    k = bisect.bisect_right(xs, x)
    share = (x - xs[k - 1]) / (xs[k] - xs[k - 1])
    return ys[k - 1] + share * (ys[k] - ys[k - 1])
