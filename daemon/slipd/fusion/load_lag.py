"""A load that takes up less than the arm asks for: how the force path sees an object turn in a grip that moves.

Weight and inertia of an object that sticks act at its centre of mass. While the apparent gravity γ of the arm keeps its
direction, force and spin are proportional to it, and so is the required friction q. The force of an object that turns
in the grip most often goes on to follow γ, but the spin does not, and q stays at the limit of friction. No fall shows
this. It is a slip only if

- q is flat all the time, near the largest that this grasp carried, and not far from the coefficient of friction,
- by the growth of γ, two stretches before ask for clearly more than was carried, and agree,
- the lag is more than the noise explains at the stated rate of false alarms, and more than any recent swing.
"""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled_part
from slipd.fusion.explained import mean_motion, ratio
from slipd.fusion.load_blocks import (
    BRIEF_S,
    CHANGES,
    LEVEL,
    MOSTLY,
    RING,
    ROUGH,
    mean_normal,
    mean_q,
    noise_of,
    vibration,
)
from slipd.fusion.rows import Row, Rows
from slipd.fusion.slide import FLAT, FROM, NEAR, begin_slide, surprise_of

STRETCH_S = 0.03
"""Means are of stretches of this length, s. Over two of them q is flat; in a swing of 5 Hz it is not."""


@compiled_part
def look_for_lag(drop: Row, ring: Rows, t_s: float, mu: float) -> None:
    """Begin a slip if q lags behind what the motion of the arm asks for."""
    k, dt = drop["block"], drop["dt"]
    p = max(2, int(STRETCH_S / dt + 0.5))
    if k % max(1, int(BRIEF_S / dt + 0.5)):
        return
    q, half, change = mean_q(ring, k, p), p // 2, 0.0
    for back in (half, 2 * half, 3 * half):
        change = max(change, abs(mean_q(ring, k - back, half) - mean_q(ring, k, half)))
    for top in (k - 2 * p, k - 3 * p):
        carried, swing = ring[top % RING]["carried"], ring[top % RING]["swing"]
        if k - top + 2 * p > drop["count"] or not q > FROM * mu or q < (1.0 - CHANGES) * carried:
            return
        late, early = _asked(drop, ring, p, top), _asked(drop, ring, p, top - p)
        lag = min(late, early) - max(q, carried)
        if lag < max(CHANGES * q, swing) or abs(late - early) > MOSTLY * lag or change > FLAT * lag:
            continue
        std, rough = noise_of(drop) * math.hypot(1.0, late / mean_q(ring, top, p)), vibration(drop, drop["rough"])
        surprise = surprise_of(lag, math.sqrt(std * std / p + ROUGH * rough * rough))
        if surprise >= drop["least_surprise"]:
            begin_slide(drop, t_s, math.nan, q, q / NEAR, surprise)
            return


@compiled_part
def _asked(drop: Row, ring: Rows, p: int, end: int) -> float:
    """Return q of the newest ``p`` blocks if it grew with γ, per normal force, since the ``p`` blocks up to ``end``.

    Returns:
        That q; 0 where γ was not known all the time, or did not keep its direction.
    """
    k = drop["block"]
    if drop["unfelt"] > end - p:
        return 0.0
    felt, before, soon = mean_motion(ring, k, p), mean_motion(ring, end, p), mean_motion(ring, end + LEVEL, p)
    growth, aside = ratio(felt[0], felt[1], before[0], before[1])
    if not abs(aside) <= MOSTLY * growth:
        return 0.0
    growth = min(growth, ratio(felt[0], felt[1], soon[0], soon[1])[0])  # the stream may lag by some milliseconds
    return float(growth * mean_normal(ring, end, p) / mean_normal(ring, k, p) * mean_q(ring, end, p))
