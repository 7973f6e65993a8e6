"""A load that falls slowly to a plateau, although it goes on: a rotation or a loosened grip that breaks away.

A contact whose parts slide one after another, or that slides on slowly, takes up to 0.15 s from μ_s to μ_d. A load that
is let go falls as slowly, so the fall alone shows nothing. Here the tangential force goes on growing meanwhile, or the
normal force goes on falling: a contact that sticks would need more friction than at the peak, and needs less.
"""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled
from slipd.fusion.load_blocks import LEVEL, RING, mean_normal, mean_q, noise_of, vibration
from slipd.fusion.rows import Row, Rows
from slipd.fusion.slide import MOST_DROP, begin_slide, surprise_of

EVERY_S = 0.004
"""It looks once in this time, and tries peaks that far apart, s."""
FALL_S = 0.15
"""The peak was at most this long ago, s."""
PLATEAU_S, PLATEAU_SHARE = 0.004, 8
"""The plateau is three stretches, each this long, s, and at least one part in so many of the fall."""
LEAST_FALL = 0.03
"""Of the peak: friction of most pairs falls by more."""
FLAT = 0.28
"""From stretch to stretch, the plateau changes by at most this part of the mean rate of the fall. At its turning point,
a swing changes faster."""
FROM = 0.7
"""The peak is at least this part of the coefficient of friction, where that is known."""
CARRIED = 0.93
"""The peak is at least this part of the largest q that the grasp carried without motion."""
RISE, RISE_S = 0.02, 0.1
"""Before the peak, q rose by this part of it within this time, s."""
STRAIGHT = 0.6
"""That rise is at least this part of the way that q went: a swing goes to and fro."""
SWINGS = 1.3
"""A fall is at least this many times the largest swing of the last second."""
GOES_ON, GOES_ON_STDS = 0.005, 3.0
"""From peak to plateau, R grows by this part of the peak, or the normal force falls by it, beyond so many of the
deviations of both."""
TIGHTER = 0.02
"""The normal force grows by at most this part: a tightened grip lowers q too."""


@compiled
def look_for_slow_fall(drop: Row, ring: Rows, t_s: float, mu: float) -> None:
    """Begin a slip if q fell slowly from a peak to a plateau while the load went on."""
    k, count, dt = drop["block"], drop["count"], drop["dt"]
    every = max(1, int(EVERY_S / dt + 0.5))
    if k % every:
        return
    least, level = max(2, int(PLATEAU_S / dt + 0.5)), max(1, min(LEVEL, int(2.0 * EVERY_S / dt + 0.5)))
    rising = max(2, int(RISE_S / dt + 0.5))
    most = min(int(FALL_S / dt + 0.5), count - rising - level - 1)
    back, peak = _find_peak(ring, k, 5 * least, most, every, level)
    if back == 0 or back + every > most or peak < CARRIED * drop["carried"] or peak < FROM * mu:
        return
    stretch = max(least, back // PLATEAU_SHARE)
    flat = 2 * stretch
    low, before = mean_q(ring, k, flat), ring[(k - back - level) % RING]
    rough = math.sqrt(2.0) * vibration(drop, before["rough"])
    fall, deviation = peak - low, math.hypot(noise_of(drop) * math.sqrt(1.0 / flat + 1.0 / level), rough)
    if not max(LEAST_FALL * peak, SWINGS * before["swing"]) <= fall <= MOST_DROP * peak:
        return
    surprise = surprise_of(fall / deviation) if deviation > 0.0 else math.inf
    if surprise < drop["least_surprise"]:
        return
    if not _is_plateau(ring, k, stretch, FLAT * fall * stretch / (back - stretch)):
        return
    if _rises(ring, k - back, rising, every, level, peak) and _goes_on(ring, k, back, flat, level, peak, deviation):
        begin_slide(drop, t_s, peak, low, peak, surprise)


@compiled
def _find_peak(ring: Rows, k: int, least: int, most: int, every: int, level: int) -> tuple[int, float]:
    """Return how many blocks ago q was largest, from ``least`` to ``most``, and its mean there; 0 blocks for none."""
    at, peak = 0, 0.0
    for back in range(least, most + 1, every):
        high = mean_q(ring, k - back, level)
        if high > peak:
            at, peak = back, high
    return at, peak


@compiled
def _is_plateau(ring: Rows, k: int, stretch: int, most: float) -> bool:
    """Return whether q changes by at most ``most`` over the three newest stretches of so many blocks, up or down."""
    newest, middle, oldest = (
        mean_q(ring, k, stretch),
        mean_q(ring, k - stretch, stretch),
        mean_q(ring, k - 2 * stretch, stretch),
    )
    return bool(max(abs(newest - middle), abs(middle - oldest)) <= most)


@compiled
def _rises(ring: Rows, top: int, rising: int, every: int, level: int, peak: float) -> bool:
    """Return whether q rose steadily to its peak at block ``top``, over ``rising`` blocks."""
    way, stride, later = 0.0, 2 * every, peak
    for back in range(stride, rising + 1, stride):
        earlier = mean_q(ring, top - back, level)
        way += abs(later - earlier)
        later = earlier
    return bool(peak - later >= max(RISE * peak, STRAIGHT * way))


@compiled
def _goes_on(ring: Rows, k: int, back: int, flat: int, level: int, peak: float, deviation: float) -> bool:
    """Return whether the load that was at its peak ``back`` blocks ago went on: more shear, or less grip."""
    before, after = mean_normal(ring, k - back, level), mean_normal(ring, k, flat)
    if after > (1.0 + TIGHTER) * before:
        return False
    grown = _mean_shear(ring, k, flat) / after - _mean_shear(ring, k - back, level) / before
    moved = max(grown / peak, (before - after) / before)
    return bool(moved > GOES_ON + GOES_ON_STDS * deviation / peak)


@compiled
def _mean_shear(ring: Rows, end: int, count: int) -> float:
    """Return the size of the mean tangential force of the blocks up to ``end``."""
    last, first = ring[end % RING], ring[(end - count) % RING]
    return math.hypot(last["fx"] - first["fx"], last["fy"] - first["fy"]) / count
