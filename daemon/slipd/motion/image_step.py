"""Evidence "image_change" of a grasp by pads that measure the force themselves: shares that change at unchanged grip.

While the object sticks, the taxels' shares of the normal force change only a little: the arm accelerates, the elastomer
creeps. When the object turns or slides in the fingers, its edges and its pressure move over the taxels. Both pads hold
the same object, so the changes of both are averaged. A motion lasts longer than a look, and what the arm does swings
back, so the larger one of the changes since the last look and since the one before counts. While the grip closes or
opens, shares change without slip.

The background is measured, not assumed: over 84 s of 13 holds with the arm moving (two 4 × 4 pads, 10 new images a
second), this change has an exponential tail of scale 0.0039 from 0.004 up to 0.014, and a thinner one up to the largest
of 794 looks, 0.028. A grasp with more background of its own raises the scale.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slipd.types.arrays import Array

LOOK_NS = 60_000_000
"""Least time between two looks: pads report 40 Hz and more, but many renew their readings at only 10 Hz."""
LOOKS_PER_HOUR = 3600.0 * 10.0
"""Independent looks in an hour; changes of the arm's motion last longer than the time between two looks."""
LONGEST_LOOK_NS = 300_000_000
"""Images further apart are not compared."""
BACKGROUND = 0.0040
"""Scale of the exponential tail of the change without slip. It is the middle of the range in which the counts on
labelled grasps change by two at most, 0.0034 to 0.0046."""
MOST_SQUEEZE = 0.1
"""Largest relative change of the normal force between two looks at which the grip counts as unchanged."""
FOLLOW = 0.05
"""Share of each new change in the running mean of the grasp's own changes."""
TAIL_SHARE = 0.55
"""Scale of the tail over the mean change of a noisy hold, 0.0040 over 0.0076, rounded up."""


class _Look(NamedTuple):
    """Shares of the taxels of each pad, and the normal force of all pads."""

    t_ns: int
    shares: list[Array]
    total: float


class ImageStep:
    """Compares the images of all pads of a grasp from look to look."""

    def __init__(self) -> None:
        self._looks: deque[_Look] = deque(maxlen=2)
        self._scale = BACKGROUND

    def forget(self) -> None:
        """Forget the grasp: it ended."""
        self._looks.clear()
        self._scale = BACKGROUND

    def update(self, pressures: Sequence[Array], t_ns: int) -> float | None:
        """Look at the newest images.

        Args:
            pressures: Normal force on each taxel of each pad, ≥ 0 with a positive sum, one array a pad; any unit.
            t_ns: When they were acquired.

        Returns:
            Surprise of the change since the looks before. None where this is no look: it is too early, an image
            repeats, the grip changed, or there is nothing to compare with.
        """
        totals = [float(pressure.sum()) for pressure in pressures]
        shares = [pressure / total for pressure, total in zip(pressures, totals, strict=True)]
        look = _Look(t_ns, shares, sum(totals))
        last = self._looks[-1] if self._looks else None
        if last is None or t_ns - last.t_ns > LONGEST_LOOK_NS:
            self._restart(look)
            return None
        if t_ns - last.t_ns < LOOK_NS or any(map(np.array_equal, shares, last.shares)):
            return None
        if not _same_grip(last, look):
            self._restart(look)
            return None
        change = max(_change(before, look) for before in self._looks if _same_grip(before, look))
        self._looks.append(look)
        surprise = change / max(self._scale, BACKGROUND)
        self._scale += FOLLOW * (TAIL_SHARE * min(change, 2.0 * self._scale) - self._scale)
        return surprise

    def _restart(self, look: _Look) -> None:
        """Compare later looks with this one."""
        self._looks.clear()
        self._looks.append(look)


def _same_grip(before: _Look, now: _Look) -> bool:
    return abs(now.total - before.total) <= MOST_SQUEEZE * now.total


def _change(before: _Look, now: _Look) -> float:
    """Return the change of the shares, as the length of a vector: the mean of all pads."""
    changes = [float(np.linalg.norm(new - old)) for new, old in zip(now.shares, before.shares, strict=True)]
    return sum(changes) / len(changes)
