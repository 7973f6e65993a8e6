"""A load that jumps beyond the limit: q stops within a millisecond, or overshoots once and is flat at once.

A load that jumps and holds swings about its new value on the springs of the pads: the crest of that swing is short
beside its rise, and a trough follows it. A contact that slides has no such spring. A jump that the arm makes is no
slip: the force has followed the motion since before it (`slipd.fusion.explained`).
"""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled_part
from slipd.fusion.explained import is_carried
from slipd.fusion.load_blocks import RING, is_closing, mean_normal, mean_q, noise_of, vibration
from slipd.fusion.rows import Row, Rows
from slipd.fusion.slide import MOST_DROP, SWINGS, begin_slide, surprise_of

JUMP_S = 0.004
"""A jump rises within this time before its corner, s."""
RISE = 0.12
"""It rises by at least this part of q in it."""
FLAT = 0.07
"""Beyond the corner, q changes by at most this part of that rise."""
SCATTER = 0.03
"""It scatters by at most this part of it, beyond its noise: the crest of a swing is bent."""
PLATEAUS, LEAST_PLATEAU_S = (2, 3, 4, 5, 6, 8, 12), 0.0035
"""Lengths of the plateau beyond the corner, in blocks, and the least one, s."""
BEYOND = 1.1
"""It goes to at least this times the largest q that the grasp carried."""
CORNER = 1.0
"""Its plateau lasts at least this part of the upper half of its rise: the crest of a swing is shorter."""
SETTLED, SETTLED_S = (8, 12, 16, 24), 0.008
"""Lengths of the plateau after an overshoot, in blocks, and the least one, s."""
GAPS, OVERSHOOT_S = (4, 8, 12, 16, 24), 0.024
"""Blocks that rise and overshoot take, and their longest time, s."""
JUMPED, OVERSHOT, RINGS = 0.2, 0.04, 0.1
"""q rises by at least the first part of it, and overshoots by at least the second; then it changes and scatters by at
most the third part of the overshoot: a contact that sticks rings on the springs of its pads."""
BENT = 0.05
"""The ends of that plateau lie above its middle by at most this part of the overshoot: a trough is bent."""
LOOSENED = 0.5
"""A fall of the normal force explains at most this part of a jump: a grip that loosens and stops makes a corner too."""
FROM, OVERSHOT_FROM = 0.66, 0.55
"""A corner, and a plateau after an overshoot, count from these parts of the coefficient of friction on; where that is
unknown, never."""


@compiled_part
def look_for_jump(drop: Row, ring: Rows, t_s: float, mu: float) -> None:
    """Begin a slip if q rose fast to more than this grasp carried before, and stopped within a block."""
    k, count = drop["block"], drop["count"]
    if drop["dt"] > JUMP_S:  # what swings is not seen
        return
    steep = max(2, int(JUMP_S / drop["dt"] + 0.5))
    for p in PLATEAUS:
        if p * drop["dt"] < LEAST_PLATEAU_S or p + steep + 2 > count:
            continue
        low, before = mean_q(ring, k, p), ring[(k - p - steep) % RING]
        rise = low - mean_q(ring, k - p - steep, 1)
        if not low > FROM * mu or rise < max(RISE * low, SWINGS * before["swing"]) or low < BEYOND * before["carried"]:
            continue
        surprise = _jump_surprise(drop, ring, p, low, rise, before["rough"])
        if surprise < drop["least_surprise"] or p < 1 + CORNER * _half_rise(drop, ring, k - p, low, steep):
            continue
        if is_closing(ring, k, count) or _loosened(ring, k, p, steep, rise / low):
            continue
        if not is_carried(drop, ring, p, k - p - steep):
            begin_slide(drop, t_s, math.nan, low, BEYOND * low, surprise)
            return


@compiled_part
def _loosened(ring: Rows, k: int, p: int, steep: int, rise: float) -> bool:
    """Return whether a fall of the normal force before the newest ``p`` blocks explains much of a relative rise."""
    after, before = mean_normal(ring, k, p), mean_normal(ring, k - p - steep, 1)
    return bool(before - after > LOOSENED * rise * before)


@compiled_part
def look_for_overshoot(drop: Row, ring: Rows, t_s: float, mu: float) -> None:
    """Begin a slip if q rose fast, overshot once, and has been flat since, at more than this grasp carried before."""
    k, count, dt = drop["block"], drop["count"], drop["dt"]
    if dt > JUMP_S or math.isnan(mu) or mean_q(ring, k, SETTLED[0]) < OVERSHOT_FROM * mu:
        return
    for p in SETTLED:
        for gap in GAPS:
            if p + gap + 4 > count or gap * dt > OVERSHOOT_S:
                break
            low, before = mean_q(ring, k, p), ring[(k - p - gap) % RING]
            rise = low - mean_q(ring, k - p - gap, 4)
            if rise < max(JUMPED * low, SWINGS * before["swing"]) or low < BEYOND * before["carried"]:
                continue
            surprise = _overshoot_surprise(drop, ring, p, gap, low)
            if p * dt < SETTLED_S or surprise < drop["least_surprise"] or is_closing(ring, k, count):
                continue
            if not is_carried(drop, ring, p, k - p - gap):
                begin_slide(drop, t_s, math.nan, low, BEYOND * low, surprise)
                return


@compiled_part
def _overshoot_surprise(drop: Row, ring: Rows, p: int, gap: int, low: float) -> float:
    """Return −ln of the probability of an overshoot by noise; 0 where there is none, or q is not flat after it.

    Args:
        drop: State.
        ring: Blocks.
        p: Blocks since the overshoot.
        gap: Blocks of rise and overshoot before them.
        low: Mean q since the overshoot.
    """
    k, half, std, crest = drop["block"], p // 2, noise_of(drop), low
    for back in range(p, p + gap):
        crest = max(crest, mean_q(ring, k - back, 2))
    over = crest - low
    if not OVERSHOT * low <= over <= MOST_DROP * crest:
        return 0.0
    change = abs(mean_q(ring, k, half) - mean_q(ring, k - half, half))
    scatter = (ring[k % RING]["q2"] - ring[(k - p) % RING]["q2"]) / p - low * low
    if change > RINGS * over + std / math.sqrt(half) or scatter > (RINGS * over) ** 2 + 2.0 * std * std:
        return 0.0
    third = p // 3
    ends, middle = mean_q(ring, k, third) + mean_q(ring, k - p + third, third), mean_q(ring, k - third, p - 2 * third)
    if 0.5 * ends - middle > BENT * over + 1.5 * std / math.sqrt(third):
        return 0.0
    return surprise_of(over, std * math.sqrt(0.5 + 1.0 / p))


@compiled_part
def _jump_surprise(drop: Row, ring: Rows, p: int, low: float, rise: float, rough: float) -> float:
    """Return −ln of the probability of a rise by noise; 0 where q is not shown to be flat after it.

    Args:
        drop: State.
        ring: Blocks.
        p: Blocks since the corner.
        low: Mean q since then.
        rise: How far it rose within JUMP_S before.
        rough: Roughness of q before the rise.
    """
    k, half, std = drop["block"], p // 2, noise_of(drop)
    change = abs(mean_q(ring, k, half) - mean_q(ring, k - p + half, half))
    scatter = (ring[k % RING]["q2"] - ring[(k - p) % RING]["q2"]) / p - low * low
    if max(change, 2.0 * std / math.sqrt(p)) > FLAT * rise or scatter > (SCATTER * rise) ** 2 + 2.0 * std * std:
        return 0.0
    rough = vibration(drop, rough)
    return surprise_of(rise, math.sqrt(std * std * (1.0 + 1.0 / p) + 2.0 * rough * rough))


@compiled_part
def _half_rise(drop: Row, ring: Rows, end: int, low: float, steep: int) -> int:
    """Return for how many blocks q was in the upper half of its rise before block ``end``."""
    most: int = min(drop["count"] - (drop["block"] - end) - 1, 8 * steep)
    least = low
    for back in range(steep, most, steep):
        least = min(least, mean_q(ring, end - back, 1))
    for back in range(most):
        if mean_q(ring, end - back, 1) < 0.5 * (low + least):
            return back
    return most
