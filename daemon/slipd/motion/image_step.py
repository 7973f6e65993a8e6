"""Evidence "image_change" of a grasp by pads that measure the force themselves: shares that change at unchanged grip.

While the object sticks, the taxels' shares of the normal force change only a little: the arm accelerates, the elastomer
creeps. When the object turns or slides in the fingers, its edges and its pressure move over the taxels. Both pads hold
the same object, so the changes of both are averaged. While the grip closes or opens, shares change without slip.

The background is measured, not assumed: over 87 s of 14 holds with the arm moving (two 4 × 4 pads, 10 new images a
second), the mean change from look to look has an exponential tail of scale 0.0034 from 0.004 up to the largest of 826
looks. A grasp with more background of its own raises the scale.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slipd.arrays import Array

LOOK_NS = 60_000_000
"""Least time between two looks: pads report 40 Hz and more, but many renew their readings at only 10 Hz."""
LOOKS_PER_HOUR = 3600.0 * 10.0
"""Independent looks in an hour; changes of the arm's motion last longer than the time between two looks."""
LONGEST_LOOK_NS = 300_000_000
"""Images further apart are not compared."""
BACKGROUND = 0.0034
"""Scale of the exponential tail of the change without slip."""
MOST_SQUEEZE = 0.1
"""Largest relative change of the normal force between two looks at which the grip counts as unchanged."""
FOLLOW = 0.05
"""Share of each new change in the running mean of the grasp's own changes."""
TAIL_SHARE = 0.6
"""Scale of the tail over the mean change of a hold: 0.0034 over 0.0055 in the noisiest of them."""


class ImageStep:
    """Compares the images of all pads of a grasp from look to look."""

    def __init__(self) -> None:
        self._before: tuple[int, list[Array], list[float]] | None = None
        self._scale = BACKGROUND

    def forget(self) -> None:
        """Forget the grasp: it ended."""
        self._before, self._scale = None, BACKGROUND

    def update(self, pressures: Sequence[Array], t_ns: int) -> float | None:
        """Look at the newest images.

        Args:
            pressures: Normal force on each taxel of each pad, ≥ 0 with a positive sum, one array a pad; any unit.
            t_ns: When they were acquired.

        Returns:
            Surprise of the change since the look before. None where this is no look: it is too early, an image
            repeats, the grip changed, or there is nothing to compare with.
        """
        totals = [float(pressure.sum()) for pressure in pressures]
        shares = [pressure / total for pressure, total in zip(pressures, totals, strict=True)]
        before = self._before
        if before is None or len(before[1]) != len(shares) or t_ns - before[0] > LONGEST_LOOK_NS:
            self._before = t_ns, shares, totals
            return None
        if t_ns - before[0] < LOOK_NS:
            return None
        changes = [float(np.linalg.norm(new - old)) for new, old in zip(shares, before[1], strict=True)]
        if 0.0 in changes:
            return None
        self._before = t_ns, shares, totals
        if abs(sum(totals) - sum(before[2])) > MOST_SQUEEZE * sum(totals):
            return None
        change = sum(changes) / len(changes)
        surprise = change / max(self._scale, BACKGROUND)
        self._scale += FOLLOW * (TAIL_SHARE * min(change, 2.0 * self._scale) - self._scale)
        return surprise
