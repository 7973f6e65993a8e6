"""A load that grows steadily reaches WARNING a hysteresis earlier: it will be there soon.

What prevents a slip is time, not load.
"""

from __future__ import annotations

from slipd.fusion.compiled import compiled
from slipd.fusion.level_hysteresis import CERTAIN_STDS
from slipd.fusion.load_blocks import LEVEL, mean_q
from slipd.fusion.rows import Row, Rows

GROWTH_S = 0.2
"""The growth of a load is that in this time, s."""
PARTS = 4
"""It is looked at in so many parts of this time: a load that jumped did not grow in each of them by at least such a
part of an equal share."""
GROWTH_PER_S = 0.15
"""A load grows from this much utilisation a second on: it would be near the limit within a second."""


@compiled
def grows(drop: Row, ring: Rows, mu: float, least: float) -> bool:
    """Return whether the load grows steadily, beyond its noise, and so fast that it would soon be near the limit.

    Args:
        drop: What is known of the load, a row of DROP.
        ring: Rows of BLOCK, shape (RING,).
        mu: Coefficient of static friction.
        least: Utilisation that the load has at least, as a mean of some milliseconds.
    """
    dt, last = drop["dt"], drop["block"]
    part = round(GROWTH_S / PARTS / dt) if dt > 0.0 else 0
    few = min(LEVEL, max(part // 5, 1))
    if part == 0 or drop["count"] < PARTS * part + few:
        return False
    newest = mean_q(ring, last, few)
    growth = newest - mean_q(ring, last - PARTS * part, few)
    if newest < least * mu or growth < max(GROWTH_PER_S * GROWTH_S * mu, CERTAIN_STDS * drop["rough"]):
        return False
    for k in range(1, PARTS + 1):
        before = mean_q(ring, last - k * part, few)
        if newest - before < growth / PARTS**2:
            return False
        newest = before
    return True
