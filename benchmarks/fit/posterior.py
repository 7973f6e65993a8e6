"""A posterior of slip from the course of the load: sources of bounded weight, tried beside the rules of the daemon.

Three hypotheses explain the last tenth of a second of q, the required friction. The contact *sticks*, and q follows the
load. It *slides*: q fell from static to dynamic friction, or a load beyond any friction came on at once, and q stays on
a plateau. Or the *load itself changed*: it was let go, set down or hit; then q falls far, goes on falling, takes longer
than it has rested since, comes back from a push, or the grip became tighter.

Each source is a number from 0 to 1, and its weight in nats is the most that it adds to the log-odds of sliding. Each
look begins anew, so nothing adds up. A fall or jump that noise explains at the stated rate of false alarms is no look.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from fit.record import Grasp

from slipd.fusion.compiled import compiled
from slipd.fusion.load_blocks import (
    BLOCK_S,
    GAP_S,
    RING,
    ROUGH,
    close_block,
    forget_load,
    is_closing,
    mean_normal,
    mean_q,
    noise_of,
    restart,
    vibration,
)
from slipd.fusion.load_drop import FIRST, LOOKS, SLOWEST_S, SPARSEST_S
from slipd.fusion.rows import BLOCK, DROP, Row, Rows, new_rows
from slipd.fusion.slide import surprise_of
from slipd.types.arrays import Array

SOURCES = (
    "prior", "limit", "beyond", "surprise", "deep", "moving", "carried", "push", "swing", "tighter", "looser", "slow",
    "young", "long", "bent", "aside", "rise",
    "jump", "jump limit", "jump rise", "jump moving", "jump beyond", "jump swing", "jump scatter", "jump long",
    "jump looser", "jump over",
)  # fmt: skip
JUMP = 17
"""Index of the first source of a jump."""
EVERY = 4
"""Blocks between two looks."""
PLATEAUS = (6, 12, 24, 48)
"""Lengths of the plateau that a look tries, in blocks."""
LONGEST, CREST = 160, 4
"""A peak is looked for in so many blocks before the plateau, as a mean of so many."""
STEEP_S = 0.008
"""A jump rises within this time, s."""
UNKNOWN = 0.65
"""Where the coefficient of friction is unknown, q counts as this part of it."""
LEAST_FALL, LEAST_JUMP = 0.03, 0.1
"""As parts of q."""
FALSE_PER_HOUR = 1.0


class Looks(NamedTuple):
    """Looks at a grasp: their times, s, shape (n,), and their sources, shape (n, 27)."""

    t_s: Array
    sources: Array


def looks(grasp: Grasp) -> Looks:
    """Return the looks of a kept grasp that noise does not explain."""
    load = np.ascontiguousarray(grasp.load)
    drop, ring = new_rows(DROP, 1), new_rows(BLOCK, RING)
    drop["last_s"] = drop["since_s"] = -math.inf
    drop["least_surprise"] = math.log(LOOKS * 3600.0 / BLOCK_S / FALSE_PER_HOUR)
    found = np.zeros((2 * len(load) + 100, 1 + len(SOURCES)))
    count = _follow(load, drop, ring, found)
    return Looks(found[:count, 0].copy(), found[:count, 1:].copy())


@compiled
def _follow(load: Array, drops: Rows, ring: Rows, found: Array) -> int:
    """Follow a load in columns of `fit.record.COLUMNS`; fill in time and sources of each look, and return how many."""
    drop, n = drops[0], 0
    for i in range(len(load)):
        t_s, q = load[i, 0], load[i, 2]
        if load[i, 1] == 0.0:
            forget_load(drop)
            continue
        if not math.isfinite(q) or t_s <= drop["last_s"]:
            continue
        if t_s - drop["last_s"] > GAP_S:
            restart(drop, ring, t_s, q)
        drop["last_s"] = t_s
        drop["n"] += 1
        drop["q"] += q
        drop["normal"] += load[i, 3]
        drop["fx"] += load[i, 4]
        drop["fy"] += load[i, 5]
        if t_s - drop["end_s"] < 0.9 * BLOCK_S:
            continue
        drop["sliding"] = int(load[i, 11]) % 2 == 1  # as the daemon took it
        close_block(drop, ring, t_s, load[i, 9] / math.sqrt(drop["n"]))
        ready = drop["count"] >= FIRST and drop["dt"] <= min(SLOWEST_S, SPARSEST_S * drop["seen"])
        if not ready or drop["block"] % EVERY != 0 or is_closing(ring, drop["block"], drop["count"]):
            continue
        for p in PLATEAUS:
            for jump in range(2):
                x = found[n, 1:]
                x[:] = 0.0
                surprise = _jump(drop, ring, load[i, 10], p, x) if jump else _fall(drop, ring, load[i, 10], p, x)
                if surprise >= drop["least_surprise"] and n < len(found) - 1:
                    found[n, 0] = t_s
                    n += 1
    return n


@compiled
def _part(value: float, low: float, high: float) -> float:
    """Return where a value lies between two others: 0 up to the first, 1 from the second on."""
    return min(max((value - low) / (high - low), 0.0), 1.0)


@compiled
def _fall(drop: Row, ring: Rows, mu: float, p: int, x: Array) -> float:
    """Fill in the sources of a fall to a plateau of ``p`` blocks; return its surprise by noise, 0 where none fell."""
    k, dt, half, third = drop["block"], drop["dt"], p // 2, p // 3
    low, high, back = mean_q(ring, k, p), 0.0, 0
    for at in range(p, min(drop["count"] - CREST - 2, p + LONGEST), 2):
        level = mean_q(ring, k - at, CREST)
        if level > high:
            high, back = level, at
    fall = high - low
    if back == 0 or fall < LEAST_FALL * high:
        return 0.0
    top, known = k - back, drop["count"] - back - CREST
    before, std = ring[(top - CREST) % RING], noise_of(drop)
    rough = vibration(drop, before["rough"])
    noise = math.sqrt(std * std * (1.0 / p + 1.0 / CREST) + ROUGH * rough * rough)
    slope = mean_q(ring, k - half, p - half) - mean_q(ring, k, half)
    ends, middle = mean_q(ring, k, third) + mean_q(ring, k - p + third, third), mean_q(ring, k - third, p - 2 * third)
    push = high - mean_q(ring, top - max(min(known - CREST, max(2 * (back - p), 8)), 0), CREST)
    rise = max(2, min(known, int(0.03 / dt)))
    few = min(8, rise)
    tighter = math.log(mean_normal(ring, k, p) / mean_normal(ring, top, CREST)) * high / fall
    newest, at_p, first, last = ring[k % RING], ring[(k - p) % RING], ring[top % RING], ring[(top - CREST) % RING]
    fx, fy = (first["fx"] - last["fx"]) / CREST, (first["fy"] - last["fy"]) / CREST
    across = abs((newest["fx"] - at_p["fx"]) * fy - (newest["fy"] - at_p["fy"]) * fx) / p
    used, longer = UNKNOWN if math.isnan(mu) else high / mu, math.log((back - p + 1.0) / p)
    x[0], x[1], x[2] = 1.0, _part(used, 0.4, 1.0), _part(used, 1.0, 1.1)
    x[3], x[4] = math.sqrt(_part(fall, 0.0, 50.0 * noise + 1e-12)), _part(fall / high, 0.3, 0.45)
    x[5], x[6] = _part(abs(slope) / fall, 0.0, 0.5), _part(high / max(before["carried"], 1e-9), 0.95, 1.01)
    x[7], x[8] = _part(push / fall, 0.0, 0.8), _part(before["swing"] / fall, 0.0, 1.0)
    x[9], x[10] = _part(tighter, 0.0, 1.0), _part(-tighter, 0.0, 0.5)
    x[11], x[12], x[13] = _part(longer, 0.0, 3.0), _part(longer, -2.0, 0.0), math.log2(p / PLATEAUS[0]) / 3.0
    x[14] = _part(abs(0.5 * ends - middle) / fall, 0.0, 0.2)
    x[15] = _part(across / max(fx * fx + fy * fy, 1e-12) * high / fall, 0.0, 0.5)
    x[16] = _part((high - mean_q(ring, top - CREST - rise + few, few)) / high, -0.02, 0.06)
    return surprise_of(fall, noise)


@compiled
def _jump(drop: Row, ring: Rows, mu: float, p: int, x: Array) -> float:
    """Fill in the sources of a jump to a plateau of ``p`` blocks; return its surprise by noise, 0 where none jumped."""
    k, half, steep = drop["block"], p // 2, max(2, int(STEEP_S / drop["dt"]))
    if drop["count"] < p + steep + 4 or drop["dt"] > STEEP_S:
        return 0.0
    low, before = mean_q(ring, k, p), ring[(k - p - steep) % RING]
    rise = low - mean_q(ring, k - p - steep, 2)
    if not rise >= LEAST_JUMP * low or rise <= 0.0:
        return 0.0
    std, rough = noise_of(drop), vibration(drop, before["rough"])
    scatter = max((ring[k % RING]["q2"] - ring[(k - p) % RING]["q2"]) / p - low * low - std * std, 0.0)
    slope = abs(mean_q(ring, k - half, p - half) - mean_q(ring, k, half))
    looser = math.log(mean_normal(ring, k - p - steep, 2) / mean_normal(ring, k, p)) * low / rise
    x[17], x[18] = 1.0, _part(UNKNOWN if math.isnan(mu) else low / mu, 0.4, 1.0)
    x[19], x[20] = _part(rise / low, 0.1, 0.5), _part(slope / rise, 0.0, 0.2)
    x[21] = _part(low / max(before["carried"], 1e-9), 1.0, 1.2)
    x[22], x[23] = _part(before["swing"] / rise, 0.0, 0.5), _part(math.sqrt(scatter) / rise, 0.0, 0.1)
    x[24], x[25] = math.log2(p / PLATEAUS[0]) / 3.0, _part(looser, 0.0, 1.0)
    x[26] = _part(mean_q(ring, k - p, 2), low, low + 0.3 * rise)
    noise = math.sqrt(std * std * (1.0 / p + 0.5) + ROUGH * rough * rough)
    return surprise_of(rise, noise)
