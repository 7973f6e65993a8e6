"""A load that asks for more friction than there is: how the force path sees a heavy object turn in the grip.

The weight of an object that sticks, and the force that accelerates it, act at its centre of mass. While that force
keeps its direction, force and spin grow in proportion, and so does the required friction q. An object that turns in the
grip, or slides, does not take up all of it: q stays at the limit of friction though the load grows. The tangential
force shows how the load grows, since it mostly follows the arm even while an object turns; so does the motion of the
arm, where it is known. It is a slip only if

- q is flat, near the largest that this grasp carried without motion, and not far from the coefficient of friction,
- two stretches before ask for clearly more, and agree,
- the lag is more than the noise explains at the stated rate of false alarms, and more than twice any swing of the last
  second.
"""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled_part
from slipd.fusion.explained import mean_motion, ratio
from slipd.fusion.load_blocks import (
    BRIEF_S,
    CHANGES,
    MOSTLY,
    QUICK_S,
    RING,
    ROUGH,
    mean_force,
    mean_normal,
    mean_q,
    noise_of,
    vibration,
)
from slipd.fusion.rows import Row, Rows
from slipd.fusion.slide import FLAT, FROM, NEAR, SWINGS, begin_slide, surprise_of

ASIDE = 0.3
"""A force keeps its direction if its part across the direction before is at most this part of that along it."""


@compiled_part
def look_for_lag(drop: Row, ring: Rows, t_s: float, mu: float) -> None:
    """Begin a slip if q lags behind what the load asks for since a stretch before."""
    k, dt = drop["block"], drop["dt"]
    p = max(2, int(QUICK_S / dt + 0.5))
    if k % max(1, int(BRIEF_S / dt + 0.5)):
        return
    q = mean_q(ring, k, p)
    change = abs(q - mean_q(ring, k - p, p))
    for top in (k - 2 * p, k - 3 * p):
        carried = ring[top % RING]["carried"]
        if k - top + 2 * p > drop["count"] or not q > FROM * mu or q < (1.0 - CHANGES) * carried:
            return
        late, early = _asked(drop, ring, p, top), _asked(drop, ring, p, top - p)
        lag = min(late, early) - q
        if lag < max(CHANGES * q, SWINGS * ring[top % RING]["swing"]):
            continue
        if abs(late - early) > MOSTLY * lag or change > FLAT * lag:
            continue
        std, rough = noise_of(drop) * math.hypot(1.0, late / mean_q(ring, top, p)), vibration(drop, drop["rough"])
        surprise = surprise_of(lag, math.sqrt(std * std / p + ROUGH * rough * rough))
        if surprise >= drop["least_surprise"]:
            begin_slide(drop, t_s, math.nan, q, q / NEAR, surprise)
            return


@compiled_part
def _asked(drop: Row, ring: Rows, p: int, end: int) -> float:
    """Return q of the newest ``p`` blocks if it had grown with the load since the ``p`` blocks up to ``end``.

    The load is the tangential force or, where the arm is known, its apparent gravity if that grew more; per normal
    force.

    Returns:
        That q; 0 where the force did not keep its direction.
    """
    k = drop["block"]
    growth, aside = ratio(*mean_force(ring, k, p), *mean_force(ring, end, p))
    if not abs(aside) <= ASIDE * growth:
        return 0.0
    if drop["unfelt"] <= end - p:
        felt, felt_before = mean_motion(ring, k, p), mean_motion(ring, end, p)
        growth = max(growth, ratio(felt[0], felt[1], felt_before[0], felt_before[1])[0])
    return float(growth * mean_normal(ring, end, p) / mean_normal(ring, k, p) * mean_q(ring, end, p))
