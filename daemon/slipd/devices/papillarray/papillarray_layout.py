"""Layout of a pillar's entry: two documents disagree which three numbers are its force, so the stream decides.

The vendor's PTSCOM 2.0 puts the displacement first, a public parser of the same protocol the force. The controller also
sends the total force of each sensor, which equals the sum of the pillars' forces only in the right layout. Without a
load both sums are about zero and decide nothing.
"""

from __future__ import annotations

import math

from slipd.devices.papillarray.papillarray_frames import Pad

FORCE_FIRST, DISPLACEMENT_FIRST = 0, 3
"""A layout is the index of the force among the six numbers of an entry."""

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
"""Smallest sum that decides, N or mm; smaller ones are noise and drift."""
TOLERANCE, RELATIVE_TOLERANCE = 0.02, 0.01
"""Largest error of the right sum, N and relative to the total force; float32 rounding alone causes it."""
CLEARLY = 10.0
"""Smallest error of the other sum, in tolerances."""
FRAMES = 5
"""Number of consecutive conclusive frames that must agree: 10 ms at 500 Hz."""

_NEITHER = -1


class Layout:
    """Find the layout from the sums of the pads.

    Attributes:
        force_at: Index of the force in an entry; None while it is unknown, and if neither layout matches.
    """

    def __init__(self) -> None:
        self.force_at: int | None = None
        self._found: int | None = None
        self._shown: int | None = None
        self._repeats = 0

    @property
    def note(self) -> str:
        """The finding, for people."""
        if self._found is None:
            return UNDECIDED
        return NEITHER if self.force_at is None else f"pillars hold {NAMES[self.force_at]}"

    def matches(self, pads: list[Pad | None]) -> bool:
        """Update with the pads of one frame; return whether the layout found so far applies to them."""
        shown = {layout for pad in pads if pad is not None for layout in _candidates(pad)}
        if shown:
            layout = shown.pop() if len(shown) == 1 else _NEITHER
            self._repeats = self._repeats + 1 if layout == self._shown else 1
            self._shown = layout
            if self._repeats >= FRAMES:
                self._found = layout
                self.force_at = None if layout == _NEITHER else layout
            if layout != self.force_at:
                return False
        return self.force_at is not None


def _candidates(pad: Pad) -> list[int]:
    """Return the layout that the sums of one pad show, or `_NEITHER`; nothing if they are inconclusive."""
    if pad.total_n is None:
        return []
    sums = pad.entries.sum(axis=0).tolist()
    first, second, total = sums[:3], sums[3:], pad.total_n
    total_n = math.hypot(*total)
    if not max(total_n, math.hypot(*first), math.hypot(*second)) >= LOAD:  # NaN is inconclusive
        return []
    tolerance = max(TOLERANCE, RELATIVE_TOLERANCE * total_n)
    errors = {FORCE_FIRST: math.dist(first, total), DISPLACEMENT_FIRST: math.dist(second, total)}
    best, other = sorted(errors, key=lambda layout: errors[layout])
    if not errors[best] <= tolerance:
        return [_NEITHER]
    clear = total_n >= LOAD and errors[other] >= CLEARLY * tolerance  # zeros in both places match no load
    return [best] if clear else []
