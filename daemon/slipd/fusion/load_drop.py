"""A load that falls from static to dynamic friction: how the force path sees an object slide.

While a contact sticks, the required friction q follows the load. When it breaks loose, q falls from μ_s to μ_d within
milliseconds and stays there, whatever the load does, until the motion ends. Other loads fall as well: of a pull that is
let go, an object that is set down, a collision, a swing. A fall is a slip only if

- q rose before: friction that carries a steady load does not give way by itself,
- it began at the recent top of q, near the largest that this grasp carried without motion,
- it is more than the noise, as stated and as measured, explains at the stated rate of false alarms, and more than twice
  any swing of the last second,
- it ended on a plateau that is shown to be flat and has lasted as long as the fall: a load that is let go falls on, or
  swings about its new value on the springs of the pads,
- the load itself gave way, along its own direction, and not the grip that became tighter,
- it is not the way back from a push, and the motion of the arm does not explain it (`slipd.fusion.explained`).

**False alarms.** The deviation of the fall is that of white noise in two means, stated or measured, and of measured
coloured noise. Gaussian noise exceeds the least surprise, ln(looks an hour / false alarms an hour), at the stated rate;
the other rules make it rarer. `tests/unit/fusion/test_load_drop.py` counts them in hours of white and coloured noise.
"""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled_part
from slipd.fusion.explained import is_explained
from slipd.fusion.load_blocks import (
    BLOCK_S,
    GAP_S,
    LENGTHS,
    LEVEL,
    QUICK_S,
    RECENT_S,
    RING,
    ROUGH,
    close_block,
    goes_aside,
    grows_tighter,
    is_closing,
    mean_q,
    noise_of,
    restart,
    vibration,
)
from slipd.fusion.load_jump import look_for_jump, look_for_overshoot
from slipd.fusion.load_lag import look_for_lag
from slipd.fusion.rows import Row, Rows
from slipd.fusion.slide import (
    BACK,
    FLAT,
    LEAST_RISE,
    MOST_DROP,
    NEAR,
    SHALLOW,
    SLIGHT,
    SWINGS,
    begin_slide,
    follow_slide,
    surprise_of,
)
from slipd.fusion.slow_fall import look_for_slow_fall

LOOKS = 30.0
"""Independent looks of each block: combinations of plateau and fall are strongly dependent."""

SLOWEST_S = 0.0125
"""Readings further apart than this do not show a fall of some milliseconds, s: two or three of them look the same when
a load is let go. Pads as slow as that show motion by their images."""
SPARSEST_S = 0.02
"""The same for the mean distance of readings that come in bunches or with gaps, s."""
FIRST = 5 * LEVEL
"""Before so many blocks the noise is not known."""
LEAST_PLATEAU_S = 0.005
"""A shorter plateau may be the turning point of a vibration, s."""
ODD = 4.0
"""A plateau lasts at least as long as its fall. Where the peak is below NEAR of μ, the fall is odd, and the plateau
must last longer: by ODD times as much where the peak is lower by MOST_DROP of μ, or where μ is unknown."""


@compiled_part
def follow_load(
    drop: Row, ring: Rows, t_s: float, q: float, normal: float, fx: float, fy: float, std: float, mu: float,
    gx: float, gy: float, turn: float,
) -> bool:  # fmt: skip
    """Add a reading and return whether the load shows that the object slides.

    Args:
        drop: Settings and state, a row of DROP.
        ring: Rows of BLOCK, shape (RING,).
        t_s: Time, s.
        q: Required friction; infinite where no friction would hold the load.
        normal: Normal force, N.
        fx: Tangential force, N.
        fy: Likewise.
        std: Standard deviation of q by the stated noise.
        mu: Coefficient of static friction; NaN: unknown.
        gx: Apparent gravity along the pad by the arm's motion, m/s²; NaN: unknown.
        gy: Likewise.
        turn: Angular velocity of the arm about the normal of the pad, rad/s.
    """
    if not math.isfinite(q) or t_s <= drop["last_s"]:
        return bool(drop["sliding"])
    if t_s - drop["last_s"] > GAP_S:
        restart(drop, ring, t_s, q)
    drop["last_s"] = t_s
    n = drop["n"] + 1
    drop["n"] = n
    drop["q"] += q
    drop["normal"] += normal
    drop["fx"] += fx
    drop["fy"] += fy
    drop["gx"], drop["gy"], drop["turn"] = gx, gy, turn
    if t_s - drop["end_s"] >= 0.9 * BLOCK_S:
        close_block(drop, ring, t_s, std / math.sqrt(n))
        if drop["sliding"]:
            follow_slide(drop, ring, t_s)
        elif drop["count"] >= FIRST and drop["dt"] <= min(SLOWEST_S, SPARSEST_S * drop["seen"]):
            _look(drop, ring, t_s, mu)
            if not drop["sliding"]:
                look_for_slow_fall(drop, ring, t_s, mu)
            if not drop["sliding"]:
                look_for_lag(drop, ring, t_s, mu)
    return bool(drop["sliding"])


@compiled_part
def _look(drop: Row, ring: Rows, t_s: float, mu: float) -> None:
    """Begin a slip if the load fell to a plateau, or jumped to one."""
    k, count, dt = drop["block"], drop["count"], drop["dt"]
    if drop["top"] - mean_q(ring, k, 2) < max(drop["least_drop"] * drop["top"], 2.0 * noise_of(drop)):
        look_for_jump(drop, ring, t_s, mu)
        return
    for p in LENGTHS:
        if (p * dt < LEAST_PLATEAU_S and p > 2) or p * dt > RECENT_S:
            continue
        b = min(max(3, p), LEVEL)
        for g in (0, 1, *LENGTHS):
            if g > p or g * dt > drop["window_s"] or p + g + b > count:
                break
            surprise = _surprise(drop, ring, p, g, b, mu)
            if surprise >= drop["least_surprise"]:
                high = mean_q(ring, k - p - g, b)
                begin_slide(drop, t_s, high, mean_q(ring, k, p), high, surprise)
                return
    look_for_overshoot(drop, ring, t_s, mu)


@compiled_part
def _surprise(drop: Row, ring: Rows, p: int, g: int, b: int, mu: float) -> float:
    """Return the surprise of a fall over ``g`` blocks from a level of ``b`` to a plateau of the newest ``p``.

    Returns:
        −ln of its probability by noise; 0 where it is not that of a slip.
    """
    k, std = drop["block"], noise_of(drop)
    top = k - p - g
    low, high = mean_q(ring, k, p), mean_q(ring, top, b)
    fall, before = high - low, ring[(top - b) % RING]
    if not drop["least_drop"] * high <= fall <= MOST_DROP * high or fall < SWINGS * before["swing"]:
        return 0.0
    odd = 1.0 if math.isnan(mu) else min(max((NEAR - high / mu) / MOST_DROP, 0.0), 1.0)
    if g * (1.0 + ODD * odd) > p + 1 or p * drop["dt"] < LEAST_PLATEAU_S * (1.0 + ODD * odd):
        return 0.0
    rough = vibration(drop, before["rough"])
    surprise = surprise_of(fall, math.sqrt(std * std * (1.0 / p + 1.0 / b) + ROUGH * rough * rough))
    if surprise < drop["least_surprise"] or not _is_flat(ring, k, p, low, fall, std):
        return 0.0
    half = b // 2
    if before["top"] - high > SLIGHT * fall + std / math.sqrt(b) or not _rose(drop, ring, top, b, high, fall):
        return 0.0
    falls_before = mean_q(ring, top - half, half) - mean_q(ring, top, half)
    if falls_before > FLAT * fall + 2.0 * std / math.sqrt(half) or high < NEAR * drop["carried"]:
        return 0.0
    if is_closing(ring, k, drop["count"]) or grows_tighter(ring, k, p, top, b, fall / high):
        return 0.0
    if goes_aside(ring, k, p, top, b) or _is_push(drop, ring, g, top - b, b, high, fall, std):
        return 0.0
    return 0.0 if is_explained(drop, ring, p, top, b, low, high) else surprise


@compiled_part
def _is_flat(ring: Rows, k: int, p: int, low: float, fall: float, std: float) -> bool:
    """Return whether the newest ``p`` blocks are shown to be flat beside a fall: no slope, no bend, little scatter."""
    half, at = p // 2, k - p
    if 2.0 * std > SLIGHT * fall * math.sqrt(p):
        return False
    if abs(mean_q(ring, k, half) - mean_q(ring, at + half, half)) > FLAT * fall:
        return False
    if p >= 6:
        third = p // 3
        ends, middle = mean_q(ring, k, third) + mean_q(ring, at + third, third), mean_q(ring, k - third, p - 2 * third)
        if abs(0.5 * ends - middle) > SLIGHT * fall + 1.5 * std / math.sqrt(third):
            return False
    scatter = (ring[k % RING]["q2"] - ring[at % RING]["q2"]) / p - low * low
    return bool(scatter <= (FLAT * fall) ** 2 + 2.0 * std * std)


@compiled_part
def _rose(drop: Row, ring: Rows, top: int, b: int, high: float, fall: float) -> bool:
    """Return whether q rose to the level of ``b`` blocks up to ``top``.

    A load may be held for a moment and then let go; from such a level, friction does not fall far.
    """
    rise_s, known = RECENT_S if fall < SHALLOW * high else QUICK_S, drop["count"] - (drop["block"] - top) - b
    before = min(max(2, int(rise_s / drop["dt"] + 0.5)), known)
    return bool(before >= 2 and high - mean_q(ring, top - b, before) >= LEAST_RISE * high)


@compiled_part
def _is_push(drop: Row, ring: Rows, g: int, end: int, b: int, high: float, fall: float, std: float) -> bool:
    """Return whether q had come up about as fast as it fell.

    Args:
        drop: State.
        ring: Blocks.
        g: Length of the fall, in blocks.
        end: Block before the level from which q fell.
        b: Length of that level.
        high: Its mean q.
        fall: How far q fell.
        std: Deviation of a block.
    """
    back = max(2 * g, int(QUICK_S / drop["dt"] + 0.5))
    known = drop["count"] - (drop["block"] - end) - b
    if known < 0:
        return True
    return high - mean_q(ring, end - min(back, known), b) > BACK * fall + 1.5 * std
