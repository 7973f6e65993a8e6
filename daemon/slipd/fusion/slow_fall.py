"""A load that falls slowly, and ever more slowly: an object that breaks away while it still moves slowly.

Friction falls from μ_s to μ_d with the speed of the object, which takes up to 0.15 s where the load drives it gently. The
fall soon becomes slower, because it ends at μ_d. A load that is let go or set down falls faster and faster until half of
it is gone. So a fall that slows down early shows slip, before it has ended. It counts only if

- the load rose steadily to a peak that is near the largest that this grasp carried, and near the coefficient of friction,
- the rate of the fall has become less than that of its fastest part, by more than noise explains; much less where the
  fall is so deep that a load let go slows down as well,
- it is more than the noise explains at the stated rate of false alarms, and more than the swings of the last second,
- it is not the way back from a push: below the coefficient of friction, q fell farther than it had risen before,
- the grip became no tighter.
"""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled
from slipd.fusion.load_blocks import LEVEL, RING, mean_normal, mean_q, noise_of
from slipd.fusion.rows import Row, Rows
from slipd.fusion.slide import MOST_DROP, begin_slide, surprise_of

EVERY_S = 0.004
"""It looks once in this time, and tries peaks that far apart, s."""
QUICKEST_S, FALL_S = 0.02, 0.16
"""The peak was at most the second time ago, and the fall took at least the first, s; faster ones are for
`slipd.fusion.load_drop`."""
LEAST_FALL = 0.025
"""Of the peak."""
LEAST_STRETCH_S, STRETCH_SHARE = 0.004, 8
"""Rates are those between two neighbouring stretches, each at least this long, s, and at least one part in so many of the
fall."""
SHALLOW, SLOWER, MUCH_SLOWER = 0.18, 0.6, 0.3
"""Up to the first part of the peak, a fall has slowed down at the second part of its fastest rate; from there on at the
third."""
RATE_STDS = 2.0
"""By so many deviations of the rate it must have slowed down."""
FROM, CARRIED = 0.68, 0.93
"""The peak is at least these parts of the coefficient of friction, where that is known, and of the largest q that the
grasp carried without motion."""
NEAR_TOP, NEAR_END = 0.05, 0.15
"""A fall lasts from when q is last within the first part of it below its peak, until it is first within the second part
of it above its end."""
RISE, LEAST_RISE_S, MOST_RISE_S = 0.12, 0.12, 0.16
"""Before the peak, q rose at this rate of its peak a second, over twice the time of the fall within these bounds, s."""
STRAIGHT = 0.6
"""That rise is at least this part of the way that q went: a swing goes to and fro."""
SWINGS = 1.3
"""A fall is at least this many times the largest swing of the last second."""
PUSH, BEYOND_PUSH = 0.65, 1.0
"""Unless its peak is beyond the second part of the coefficient of friction, q rose in the time of the fall by at most the
first part of it."""
TIGHTER = 0.2
"""The normal force grows by at most this part of what alone would explain the fall."""


@compiled
def look_for_slow_fall(drop: Row, ring: Rows, t_s: float, mu: float) -> None:
    """Begin a slip if q rose steadily to a peak and fell from there ever more slowly."""
    k, count, dt = drop["block"], drop["count"], drop["dt"]
    every = max(1, int(EVERY_S / dt + 0.5))
    if k % every:
        return
    level, least_rise = max(1, min(LEVEL, int(2.0 * EVERY_S / dt + 0.5))), max(2, int(LEAST_RISE_S / dt + 0.5))
    most = min(int(FALL_S / dt + 0.5), count - least_rise - level - 1)
    back, peak = _find_peak(ring, k, max(2, int(QUICKEST_S / dt + 0.5)), most, every, level)
    if back < level + 2 or back + every > most or peak < FROM * mu:
        return
    before = ring[(k - back - level) % RING]
    if peak < CARRIED * before["carried"]:
        return
    noise = max(before["rough"], noise_of(drop) / math.sqrt(LEVEL)) * math.sqrt(LEVEL)  # of a block
    low = _level_of_slowed_fall(ring, k, back - level // 2, peak, noise, max(1, int(LEAST_STRETCH_S / dt + 0.5)))
    fall = peak - low
    if not max(LEAST_FALL * peak, SWINGS * before["swing"]) <= fall <= MOST_DROP * peak:
        return
    surprise = surprise_of(fall / (noise * math.sqrt(2.0 / level))) if noise > 0.0 else math.inf
    begun = _last_above(ring, k, level, back, every, level, peak - NEAR_TOP * fall)
    took = begun - _first_below(ring, k, begun, every, level, low + NEAR_END * fall)
    if surprise < drop["least_surprise"]:
        return
    if not _rises(ring, k - begun, took, count - begun - level, dt, level, peak):
        return
    earlier = max(k - 2 * back, k - count + level)
    if peak < BEYOND_PUSH * mu or math.isnan(mu):
        if peak - mean_q(ring, earlier, level) > PUSH * fall + 2.0 * noise / math.sqrt(level):
            return
    if mean_normal(ring, k, level) <= (1.0 + TIGHTER * fall / peak) * mean_normal(ring, k - back, level):
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
def _last_above(ring: Rows, k: int, least: int, most: int, every: int, level: int, high: float) -> int:
    """Return how many blocks ago, from ``least`` to ``most``, q was last at ``high`` or above."""
    for back in range(least, most, every):
        if mean_q(ring, k - back, level) >= high:
            return back
    return most


@compiled
def _first_below(ring: Rows, k: int, most: int, every: int, level: int, low: float) -> int:
    """Return how many blocks ago, at most ``most``, q was first at ``low`` or below since then; 0 if it was not."""
    for back in range(most, 0, -every):
        if mean_q(ring, k - back, level) <= low:
            return back
    return 0


@compiled
def _level_of_slowed_fall(ring: Rows, k: int, fallen: int, peak: float, noise: float, least: int) -> float:
    """Return the level that a fall over ``fallen`` blocks has reached; the peak where it has not slowed down.

    Args:
        ring: Blocks.
        k: The newest.
        fallen: Blocks since the peak.
        peak: q there.
        noise: Deviation of q of a block.
        least: Shortest stretch that is averaged, in blocks.
    """
    stretch = max(least, fallen // STRETCH_SHARE)
    while 2 * stretch <= fallen // 2:
        low = mean_q(ring, k, stretch)
        last, fastest = mean_q(ring, k - stretch, stretch) - low, 0.0
        for back in range(stretch, fallen - stretch + 1, max(1, stretch // 2)):
            fastest = max(fastest, mean_q(ring, k - back - stretch, stretch) - mean_q(ring, k - back, stretch))
        slower = SLOWER if peak - low < SHALLOW * peak else MUCH_SLOWER
        if abs(last) <= slower * fastest - RATE_STDS * noise / math.sqrt(stretch):
            return float(low)
        stretch *= 2
    return peak


@compiled
def _rises(ring: Rows, top: int, took: int, known: int, dt: float, level: int, peak: float) -> bool:
    """Return whether q rose steadily to its peak at block ``top``, before a fall that took ``took`` blocks."""
    wanted = min(max(2.0 * took * dt, LEAST_RISE_S), MOST_RISE_S)
    stride = max(1, int(wanted / (8.0 * dt) + 0.5))
    steps = min(8, known // stride)
    way, later = 0.0, peak
    for step in range(1, steps + 1):
        earlier = mean_q(ring, top - step * stride, level)
        way += abs(later - earlier)
        later = earlier
    return bool(steps >= 2 and peak - later >= max(RISE * steps * stride * dt * peak, STRAIGHT * way))
