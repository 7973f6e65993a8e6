"""Slip told by the drop of R from the static to the dynamic friction coefficient (paper, after eq. (4)).

R also falls when the grip is tightened, and the load falls when an object is set down. A drop counts as slip only when
the load itself gives way, quickly, and came from near the friction limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slipd.fusion.compiled import compiled

#: Readings of the window that are kept at first; the ring grows when they come faster.
FIRST_CAPACITY = 64


@dataclass(frozen=True, slots=True)
class SlipSettings:
    """When a drop is a slip.

    Attributes:
        drop: Least relative fall of R and of the load, below the ratio of dynamic to static friction of most pairs.
        window_s: The fall happens within this time; setting an object down takes longer, s.
        armed_at: Least utilisation within the window: slip begins at 1, and the estimate of μ is a safe one.
        hold_s: A slip told stays told this long, s.
    """

    drop: float = 0.12
    window_s: float = 0.04
    armed_at: float = 0.7
    hold_s: float = 0.25


@compiled
def _watch(
    ring: NDArray[np.float64],
    first: int,
    count: int,
    oldest_s: float,
    t_s: float,
    load: float,
    ratio: float,
    utilisation: float,
    kept: float,
    armed_at: float,
) -> int:
    """Drops what is older than the window, looks for a fall, and adds the reading.

    Returns:
        Twice the place of the first reading that is kept, or the next place with a fall, which forgets all before;
        odd with a fall.
    """
    size = len(ring)
    at = first
    left = count
    while left > 0 and ring[at, 0] < oldest_s:
        at += 1
        left -= 1
        if at == size:
            at = 0
    begin = at
    fell = False
    for _k in range(left):
        if ring[at, 3] >= armed_at and load <= kept * ring[at, 1] and ratio <= kept * ring[at, 2]:
            fell = True
            break
        at += 1
        if at == size:
            at = 0
    end = (first + count) % size
    ring[end, 0], ring[end, 1], ring[end, 2], ring[end, 3] = t_s, load, ratio, utilisation
    return 2 * end + 1 if fell else 2 * begin


class SlipDetector:
    """Watches one load (the tangential force, or the spin) of one contact."""

    def __init__(self, settings: SlipSettings) -> None:
        self._settings = settings
        self._ring = np.empty((FIRST_CAPACITY, 4))  # time s, load, ratio, utilisation
        self._first = self._count = 0
        self._until_s = -math.inf

    def reset(self) -> None:
        """Forgets everything: the contact ended."""
        self._count = 0
        self._until_s = -math.inf

    def update(self, t_s: float, load: float, normal_n: float, utilisation: float) -> bool:
        """Takes one reading.

        Args:
            t_s: Time of the reading, s, rising.
            load: |f_t| in N, or |m| in N·m.
            normal_n: f_n, N, positive.
            utilisation: λ of this reading; NaN where it is not known, which arms nothing.

        Returns:
            Whether the contact slips, or did within the last ``hold_s``.
        """
        settings = self._settings
        size = len(self._ring)
        if self._count == size:
            self._ring = np.vstack((np.roll(self._ring, -self._first, axis=0), np.empty_like(self._ring)))
            self._first, size = 0, 2 * size
        found = _watch(
            self._ring,
            self._first,
            self._count,
            t_s - settings.window_s,
            t_s,
            load,
            load / normal_n,
            utilisation,
            1.0 - settings.drop,
            settings.armed_at,
        )
        end = self._first + self._count
        self._first = found >> 1
        self._count = (end - self._first) % size + 1
        if found & 1:
            self._until_s = t_s + settings.hold_s
        return t_s < self._until_s
