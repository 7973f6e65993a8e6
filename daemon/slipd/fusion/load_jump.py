"""A load that jumps beyond the limit: q stops within a millisecond, or overshoots once and is flat at once.

A load that jumps and holds swings about its new value on the springs of the pads: the crest of that swing is short
beside its rise, and a trough follows it. A contact that slides has no such spring. A jump that the arm makes is no
slip (`slipd.fusion.explained`).
"""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled_part
from slipd.fusion.explained import is_arm_made
from slipd.fusion.load_blocks import (
    BRIEF_S,
    LENGTHS,
    LEVEL,
    MOSTLY,
    QUICK_S,
    RING,
    is_closing,
    mean_normal,
    mean_q,
    noise_of,
    vibration,
)
from slipd.fusion.rows import Row, Rows
from slipd.fusion.slide import (
    FROM,
    MOST_DROP,
    NEAR,
    SLIGHT,
    SWINGS,
    begin_slide,
    surprise_of,
)

JUMPED = 0.15
"""A jump rises by at least this part of q: within BRIEF_S, after which it lasts as long, or before it overshoots."""
SCATTER = 0.03
"""It scatters by at most this part of it, beyond its noise: the crest of a swing is bent."""
PLATEAUS, SETTLED, GAPS = LENGTHS[:6], LENGTHS[5:8], LENGTHS[2:]
"""Lengths in blocks: of the plateau beyond a corner, of that after an overshoot, and of the overshoot with its rise."""


@compiled_part
def look_for_jump(drop: Row, ring: Rows, t_s: float, mu: float) -> None:
    """Begin a slip if q rose fast to more than this grasp carried before, and stopped within a block."""
    k, count = drop["block"], drop["count"]
    if drop["dt"] > BRIEF_S:  # what swings is not seen
        return
    steep = max(2, int(BRIEF_S / drop["dt"] + 0.5))
    for p in PLATEAUS:
        if p < steep or p + steep + 2 > count:
            continue
        low, before = mean_q(ring, k, p), ring[(k - p - steep) % RING]
        rise = low - mean_q(ring, k - p - steep, 1)
        if not low > FROM * mu or rise < max(JUMPED * low, SWINGS * before["swing"]) or NEAR * low < before["carried"]:
            continue
        surprise = _jump_surprise(drop, ring, p, low, rise, before["rough"])
        if surprise < drop["least_surprise"] or p < 1 + _half_rise(drop, ring, k - p, low, steep):
            continue
        if is_closing(ring, k, count) or _loosened(ring, k, p, steep, rise / low):
            continue
        if not is_arm_made(drop, ring, k - p - steep):
            begin_slide(drop, t_s, math.nan, low, low / NEAR, surprise)
            return


@compiled_part
def _loosened(ring: Rows, k: int, p: int, steep: int, rise: float) -> bool:
    """Return whether a fall of the normal force before the newest ``p`` blocks explains much of a relative rise."""
    after, before = mean_normal(ring, k, p), mean_normal(ring, k - p - steep, 1)
    return bool(before - after > MOSTLY * rise * before)


@compiled_part
def look_for_overshoot(drop: Row, ring: Rows, t_s: float, mu: float) -> None:
    """Begin a slip if q rose fast, overshot once, and has been flat since, at more than this grasp carried before."""
    k, count, dt = drop["block"], drop["count"], drop["dt"]
    if dt > BRIEF_S or math.isnan(mu) or mean_q(ring, k, LEVEL) < FROM * mu:
        return
    for p in SETTLED:
        for gap in GAPS:
            if p + gap + 4 > count or gap * dt > QUICK_S:
                break
            low, before = mean_q(ring, k, p), ring[(k - p - gap) % RING]
            rise = low - mean_q(ring, k - p - gap, 4)
            if rise < max(JUMPED * low, SWINGS * before["swing"]) or NEAR * low < before["carried"]:
                continue
            surprise = _overshoot_surprise(drop, ring, p, gap, low)
            if surprise < drop["least_surprise"] or is_closing(ring, k, count):
                continue
            if not is_arm_made(drop, ring, k - p - gap):
                begin_slide(drop, t_s, math.nan, low, low / NEAR, surprise)
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
    if not drop["least_drop"] * low <= over <= MOST_DROP * crest:
        return 0.0
    change = abs(mean_q(ring, k, half) - mean_q(ring, k - half, half))
    scatter = (ring[k % RING]["q2"] - ring[(k - p) % RING]["q2"]) / p - low * low
    if change > SLIGHT * over + std / math.sqrt(half) or scatter > (SLIGHT * over) ** 2 + 2.0 * std * std:
        return 0.0
    third = p // 3
    ends, middle = mean_q(ring, k, third) + mean_q(ring, k - p + third, third), mean_q(ring, k - third, p - 2 * third)
    if 0.5 * ends - middle > SLIGHT * over + 1.5 * std / math.sqrt(third):
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
        rise: How far it rose within BRIEF_S before.
        rough: Roughness of q before the rise.
    """
    k, half, std = drop["block"], p // 2, noise_of(drop)
    change = abs(mean_q(ring, k, half) - mean_q(ring, k - p + half, half))
    scatter = (ring[k % RING]["q2"] - ring[(k - p) % RING]["q2"]) / p - low * low
    if max(change, 2.0 * std / math.sqrt(p)) > SLIGHT * rise or scatter > (SCATTER * rise) ** 2 + 2.0 * std * std:
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
