"""A load that falls slowly, and ever more slowly: an object that breaks away while its speed is small.

Friction falls from μ_s to μ_d with the speed of the object, which takes up to 0.15 s where the load drives it gently.
The fall soon slows down, because it ends at μ_d. A load that is let go or set down falls faster and faster until half
of it is gone. So a fall that slows down early shows slip before it has ended. It counts only if

- before it and since the begin of the last slip, q rose, neither in a bump nor to a push that was held, to a
  peak near the largest q that this grasp carried and near the coefficient of friction,
- the fall is slower now than in its fastest part, by more than noise explains; much slower if it is so deep that a load
  let go slows down as well,
- it is more than the noise explains at the stated rate of false alarms, and more than the swings of the last second,
- it is not the way back from a push: q falls farther than it rose before, unless it came near the coefficient of
  friction,
- the load gives way along its own direction, the grip becomes no tighter, and the motion of the arm does not explain
  the fall.

If the tangential force grows meanwhile, or the normal force falls, a contact that sticks would need more friction than
at the peak. It needs less, so noise may then hide by how much the fall slows down.
"""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled_part
from slipd.fusion.explained import is_explained
from slipd.fusion.load_blocks import (
    BRIEF_S,
    LEVEL,
    QUICK_S,
    RECENT_S,
    RING,
    ROUGH,
    goes_aside,
    grows_tighter,
    mean_force,
    mean_normal,
    mean_q,
    noise_of,
    vibration,
)
from slipd.fusion.rows import Row, Rows
from slipd.fusion.slide import (
    BACK,
    FROM,
    LEAST_RISE,
    MOST_DROP,
    NEAR,
    SHALLOW,
    SWINGS,
    begin_slide,
    surprise_of,
)

SLOWER, MUCH_SLOWER = 0.75, 0.55
"""A shallow fall has slowed down when its rate is at most SLOWER times its fastest rate, a deeper one at MUCH_SLOWER
times that rate. A rate is the difference of the means of two neighbouring stretches."""
RATE_STDS = 5.5
"""Least slowing down of a fall, in standard deviations of the noise, unless the load went on: since the peak, the
tangential force grew or the normal force fell by more than LEAST_RISE, and the normal force grew by no more."""
NEAR_TOP = 0.05
"""A fall begins where q was last above the peak less this part of the fall."""
RISE_S = 0.12
"""Before the fall, q rose for so long, s."""
STEADY = 0.15
"""Each half of that rise has at least this part of it: of a push that is held the later half has less, of a bump the
earlier one."""
PUSH = 0.65
"""In a time as long as the fall before the peak, q rose by at most this part of the fall, unless the peak is near the
coefficient of friction."""


@compiled_part
def look_for_slow_fall(drop: Row, ring: Rows, t_s: float, mu: float) -> None:
    """Begin a slip if q rose steadily to a peak, and fell from there ever more slowly."""
    k, count, dt = drop["block"], drop["count"], drop["dt"]
    every = max(1, int(BRIEF_S / dt + 0.5))
    if k % every:
        return
    level, rise = max(1, min(LEVEL, int(2.0 * BRIEF_S / dt + 0.5))), max(2, int(RISE_S / dt + 0.5))
    oldest = int(min(RECENT_S, t_s - drop["since_s"]) / dt + 0.5)  # an earlier slip explains what came before it
    quickest, most = max(level + 2, int(QUICK_S / dt + 0.5)), min(oldest, count - rise - level - 1)
    back, peak = _find_peak(ring, k, quickest, most, every, level)
    before = ring[(k - back - level) % RING]
    if back == 0 or back + every > most or peak < FROM * mu or peak < NEAR * before["carried"]:
        return
    noise = max(before["rough"] * math.sqrt(LEVEL), noise_of(drop))  # of a block
    hides = 0.0 if _goes_on(ring, k, back, level, peak) else noise
    low = _level_of_slowed_fall(ring, k, back - level // 2, peak, hides, max(1, int(BRIEF_S / dt + 0.5)))
    fall, surprise = peak - low, _surprise_of_fall(drop, before, peak, low, noise, level)
    if surprise < drop["least_surprise"] or goes_aside(ring, k, level, k - back, level):
        return
    top = k - _last_above(ring, k, level, back, every, level, peak - NEAR_TOP * fall)
    if not _rises(ring, top, rise, level, peak):
        return
    risen = peak - mean_q(ring, max(k - 2 * back, k - count + level), level)
    if not peak >= NEAR * mu and risen > PUSH * fall + 2.0 * noise / math.sqrt(level):
        return
    tightens = grows_tighter(ring, k, level, k - back, level, fall / peak)
    if not tightens and not is_explained(drop, ring, level, k - back, level, low, peak):
        begin_slide(drop, t_s, peak, low, peak, surprise)


@compiled_part
def _surprise_of_fall(drop: Row, before: Row, peak: float, low: float, noise: float, level: int) -> float:
    """Return −ln of the probability of a fall by noise; 0 where it is too small, too large, or a swing.

    Args:
        drop: State.
        before: The block before the peak.
        peak: q at the peak, a mean of ``level`` blocks.
        low: q at the end of the fall.
        noise: Deviation of q of a block.
        level: Blocks.
    """
    fall, rough = peak - low, vibration(drop, before["rough"])
    if not max(drop["least_drop"] * peak, SWINGS * before["swing"]) <= fall <= MOST_DROP * peak:
        return 0.0
    if drop["swing"] > max(before["swing"], BACK * fall):
        return 0.0
    deviation = math.sqrt(2.0 / level * noise * noise + ROUGH * rough * rough)
    return surprise_of(fall, deviation)


@compiled_part
def _find_peak(ring: Rows, k: int, least: int, most: int, every: int, level: int) -> tuple[int, float]:
    """Return how many blocks ago q was largest, from ``least`` to ``most``, and its mean there; 0 blocks for none."""
    at, peak = 0, 0.0
    for back in range(least, most + 1, every):
        high = mean_q(ring, k - back, level)
        if high > peak:
            at, peak = back, high
    return at, peak


@compiled_part
def _last_above(ring: Rows, k: int, least: int, most: int, every: int, level: int, high: float) -> int:
    """Return how many blocks ago, from ``least`` to ``most``, q was last at ``high`` or above."""
    for back in range(least, most, every):
        if mean_q(ring, k - back, level) >= high:
            return back
    return most


@compiled_part
def _level_of_slowed_fall(ring: Rows, k: int, fallen: int, peak: float, noise: float, least: int) -> float:
    """Return the level that a fall over ``fallen`` blocks has reached; the peak where it has not slowed down.

    Args:
        ring: Blocks.
        k: The newest.
        fallen: Blocks since the peak.
        peak: q there.
        noise: Deviation of q of a block that may hide a rate.
        least: Shortest stretch that is averaged, in blocks.
    """
    stretch = max(least, fallen // LEVEL)
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


@compiled_part
def _goes_on(ring: Rows, k: int, back: int, level: int, peak: float) -> bool:
    """Return whether the load that was at its peak ``back`` blocks ago went on: more shear, or less grip."""
    before, after = mean_normal(ring, k - back, level), mean_normal(ring, k, level)
    shear_before, shear = math.hypot(*mean_force(ring, k - back, level)), math.hypot(*mean_force(ring, k, level))
    grown = shear / after - shear_before / before
    moved = max(grown / peak, (before - after) / before)
    return bool(after <= (1.0 + LEAST_RISE) * before and moved > LEAST_RISE)


@compiled_part
def _rises(ring: Rows, top: int, rise: int, level: int, peak: float) -> bool:
    """Return whether q rose steadily to its peak at block ``top``, over ``rise`` blocks; means are of ``level``."""
    half = peak - mean_q(ring, top - rise // 2, level)
    risen = peak - mean_q(ring, top - rise, level)
    return bool(risen >= LEAST_RISE * peak and min(half, risen - half) >= STEADY * risen)
