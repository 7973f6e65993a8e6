"""Find which three numbers of a pillar's entry are its force: two documents disagree, so the stream decides.

The vendor's PTSCOM 2.0 puts the displacement first, and a public parser of the same protocol the force. The controller
also sends the total force of each sensor, and only in the right layout do the pillars' forces add up to it. Without a
load both sums are about zero, and nothing is decided.
"""

from __future__ import annotations

import math

from slipd.devices.papillarray_frames import Pad

FORCE_FIRST, DISPLACEMENT_FIRST = 0, 3
"""A layout is where the force begins among the six numbers of an entry."""

NAMES = {
    DISPLACEMENT_FIRST: "displacement before force, as PTSCOM 2.0 says",
    FORCE_FIRST: "force before displacement, as PTSCOM 2.0 does not say",
}

UNDECIDED = (
    "it is not known yet which numbers of a pillar are its force: press a pad with more than 0.5 N, and the sum of its"
    " pillars will show it"
)
NEITHER = "in no known layout do the pillars' forces add up to the sensor's whole force: its readings are refused"

LOAD = 0.5
"""N, or mm: sums below this are noise and drift, and decide nothing."""
TOLERANCE, RELATIVE_TOLERANCE = 0.02, 0.01
"""N, and share of the whole force: how well the right sum fits. It differs by the rounding of float32 alone."""
CLEARLY = 10.0
"""The other sum must miss by this many tolerances."""
FRAMES = 5
"""This many conclusive frames in a row must agree: 10 ms at 500 Hz."""

_NEITHER = -1


class Layout:
    """Watches the sums of the pads.

    Attributes:
        force_at: Where the force begins in an entry; None while that is not known, and where neither layout fits.
    """

    def __init__(self) -> None:
        self.force_at: int | None = None
        self._found: int | None = None
        self._said: int | None = None
        self._times = 0

    @property
    def note(self) -> str:
        """The finding, for people."""
        if self._found is None:
            return UNDECIDED
        return NEITHER if self.force_at is None else f"pillars hold {NAMES[self.force_at]}"

    def fits(self, pads: list[Pad | None]) -> bool:
        """Update with the pads of one frame; return whether the layout found so far gives their forces."""
        shown = {layout for pad in pads if pad is not None for layout in _shown(pad)}
        if shown:
            said = shown.pop() if len(shown) == 1 else _NEITHER
            self._times = self._times + 1 if said == self._said else 1
            self._said = said
            if self._times >= FRAMES:
                self._found = said
                self.force_at = None if said == _NEITHER else said
            if said != self.force_at:
                return False
        return self.force_at is not None


def _shown(pad: Pad) -> list[int]:
    """Return the layout that the sums of one pad show, or `_NEITHER`; empty where they show nothing."""
    if pad.whole_n is None:
        return []
    sums = pad.entries.sum(axis=0).tolist()
    first, second, whole = sums[:3], sums[3:], pad.whole_n
    whole_n = math.hypot(*whole)
    if not max(whole_n, math.hypot(*first), math.hypot(*second)) >= LOAD:  # NaN shows nothing
        return []
    tolerance = max(TOLERANCE, RELATIVE_TOLERANCE * whole_n)
    misses = {FORCE_FIRST: math.dist(first, whole), DISPLACEMENT_FIRST: math.dist(second, whole)}
    best, other = sorted(misses, key=lambda layout: misses[layout])
    if not misses[best] <= tolerance:
        return [_NEITHER]
    clear = whole_n >= LOAD and misses[other] >= CLEARLY * tolerance  # numbers that are all zero fit no load
    return [best] if clear else []
