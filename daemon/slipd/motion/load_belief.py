"""Belief that the object moves, from the load of a grasp alone: how near it is to what friction carries.

Two utilisations count, the larger one decides: that of the tangential force alone, R / μ, and that of the spin alone,
m / (μ f_n ρ), with ρ the mean distance of the normal load from its centroid. Both pads carry the same twist of the
object, with opposite signs about their own normals: half the difference of their spins is the load, and their mean an
error of both. A pad with 10 new images a second lags behind an object that swings, so a load is extrapolated by half of
its last change.

What a grasp carried before without motion shows that μ is larger: a load below that adds no belief.
"""

from __future__ import annotations

from collections import deque

BELIEF_AT_LIMIT = 6.9
"""Odds of motion at the friction limit over those without load, in nats: 1000. They grow evenly with the load between,
as for a coefficient of friction known to about 20 %."""
AHEAD = 0.5
"""Part of the last change by which a load is extrapolated."""
NEAR_CARRIED = 0.85
"""A load above this share of the largest that was carried is a new one."""
SETTLED_LOOKS = 2
"""A load counts as carried when this many looks later nothing moves."""


class LoadBelief:
    """Follows the load of a grasp from look to look."""

    def __init__(self) -> None:
        self._spin: float | None = None
        self._tangential = 0.0
        self._carried = 0.0
        self._recent: deque[float] = deque(maxlen=SETTLED_LOOKS)

    def forget(self) -> None:
        """Forget the grasp: it ended."""
        self._spin = None
        self.forget_carried()

    def forget_carried(self) -> None:
        """Forget what was carried: the object moved, and lies otherwise now."""
        self._carried = 0.0
        self._recent.clear()

    def update(self, spin: float, tangential: float) -> float:
        """Add a look.

        Args:
            spin: Utilisation by the spin alone, with the sign of the spin.
            tangential: Utilisation by the tangential force alone, ≥ 0.

        Returns:
            Odds of motion over those without load, in nats.
        """
        if self._spin is None:
            self._spin, self._tangential = spin, tangential
        ahead = max(abs(spin + AHEAD * (spin - self._spin)), tangential + AHEAD * (tangential - self._tangential))
        self._spin, self._tangential = spin, tangential
        if len(self._recent) == SETTLED_LOOKS:
            self._carried = max(self._carried, self._recent[0])
        self._recent.append(max(abs(spin), tangential))
        return BELIEF_AT_LIMIT * ahead if ahead >= NEAR_CARRIED * self._carried else 0.0
