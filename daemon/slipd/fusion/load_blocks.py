"""The course of a contact's load in blocks: running sums in a ring, and what is followed beside them.

A block is a millisecond of readings, or one reading where they come more slowly. Blocks follow each other in equal
steps of time: where readings are missing, blocks on a straight line take their place, so that a load that jumped
meanwhile does not look like one that fell at once. Those blocks carry no information about the noise. Sums up to each
block give the mean of any stretch of blocks at once. Beside them are followed, each with its own time constant: the top
of q, the largest that was carried without motion, the largest swing, and the noise of q.
"""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.rows import Row, Rows

BLOCK_S = 0.001
"""Readings are averaged over this time first; where they come more slowly, each is a block of its own."""
RING = 256
"""Blocks that are kept, a power of two."""
GAP_S = 0.1
"""After a longer silence nothing is known of the load before, s."""
LEVEL = 8
"""Most blocks that are averaged for a level: a period of 120 Hz at 1 kHz."""
STEPS = 8
"""Steps of time over which the length of a block is averaged: the times of single readings jitter."""

BRIEF_S, QUICK_S, RECENT_S, MEMORY_S = 0.004, 0.024, 0.15, 1.0
"""Times over which the load is judged, s. A jump rises within BRIEF_S, and slow falls are searched once in BRIEF_S.
QUICK_S: the longest overshoot, the rise before a deep fall, the shortest slow fall. RECENT_S: the longest plateau and
slow fall, the rise before a shallow fall, the decay of top and crest. Noise and swings are forgotten with MEMORY_S."""
STDS = 3.0
"""Noise explains at most so many standard deviations: a difference counts as no more, so that one fall of the load
hardly changes the measured noise, and q leaves the plateau of a slide by more."""
SECOND = 0.512
"""√(π/2) / √6: deviation of white noise over the mean size of its second differences."""

ROUGH = 6.0
"""Coloured noise adds so many of its variances to that of a fall: two means, of which one is the largest of many."""
MOSTLY = 0.5
"""A change has another cause where that makes up more than this part: the load that gives way across its direction, the
normal force that falls before a jump, what two stretches before a lag differ by."""
TIGHTER = 0.2
"""A grip grows tighter where its normal force grows by more than this part of the growth that would explain a fall."""

LENGTHS = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48)
"""Lengths of a plateau, a fall, and an overshoot that are tried, in blocks."""
CHANGES = 0.1
"""The grip closes where the normal force grows by this part within the longest of these lengths; a slide ends where q
leaves its plateau by it; q lags by at least this part of it, and is below what was carried by no more."""


@compiled
def forget_load(drop: Row) -> None:
    """Forget the load: nothing is known of it before the next reading."""
    drop["n"], drop["count"], drop["last_s"], drop["carried"] = 0, 0, -math.inf, 0.0
    drop["sliding"], drop["rough"], drop["white"], drop["std"], drop["swing"] = False, 0.0, 0.0, 0.0, 0.0
    drop["seen"], drop["gap"] = 1.0, 1


@compiled_part
def restart(drop: Row, ring: Rows, t_s: float, q: float) -> None:
    """Begin a new sequence of blocks with required friction q: what was before is too long ago."""
    forget_load(drop)
    drop["block"], drop["end_s"] = 0, t_s - BLOCK_S
    drop["q"], drop["normal"], drop["fx"], drop["fy"] = 0.0, 0.0, 0.0, 0.0
    drop["top"], drop["smooth"], drop["crest"], drop["trough"] = q, q, q, q
    row = ring[0]
    row["q"], row["q2"], row["normal"], row["fx"], row["fy"] = 0.0, 0.0, 0.0, 0.0, 0.0
    row["gx"], row["gy"], row["turn"], drop["unfelt"] = 0.0, 0.0, 0.0, 0


@compiled_part
def close_block(drop: Row, ring: Rows, t_s: float, std: float) -> None:
    """Add the open block to the ring, after blocks on a straight line for those that are missing before it."""
    n, count, k = drop["n"], drop["count"], drop["block"]
    q, normal, fx, fy = drop["q"] / n, drop["normal"] / n, drop["fx"] / n, drop["fy"] / n
    step, missing = min(t_s - drop["end_s"], GAP_S), 0
    if count > 1:
        missing = max(int(step / drop["dt"] - 0.5), 0)
        step /= missing + 1
        step = drop["dt"] + (step - drop["dt"]) / min(count, STEPS)
    drop["n"], drop["end_s"], drop["dt"], drop["std"] = 0, t_s, step, std
    drop["q"], drop["normal"], drop["fx"], drop["fy"] = 0.0, 0.0, 0.0, 0.0
    if missing > 0:
        part = 1.0 / (missing + 1)
        last, before = ring[k % RING], ring[(k - 1) % RING]
        q_last, normal_last = last["q"] - before["q"], last["normal"] - before["normal"]
        fx_last, fy_last = last["fx"] - before["fx"], last["fy"] - before["fy"]
        for at in range(1, missing + 1):
            new, old = at * part, 1.0 - at * part
            line = (old * q_last + new * q, old * normal_last + new * normal, old * fx_last + new * fx)
            _add_block(drop, ring, *line, old * fy_last + new * fy, 0)
    _add_block(drop, ring, q, normal, fx, fy, missing + 1)


@compiled_part
def _add_block(drop: Row, ring: Rows, q: float, normal: float, fx: float, fy: float, gap: int) -> None:
    """Add a block to the running sums, and follow means; follow the noise of one that was seen.

    Args:
        drop: State.
        ring: Blocks.
        q: Required friction of the block.
        normal: Normal force, N.
        fx: Tangential force, N.
        fy: Likewise.
        gap: Blocks since the last one with readings; 0: this one has none.
    """
    k, count, dt = drop["block"] + 1, min(drop["count"] + 1, RING - 1), drop["dt"]
    before, row = ring[(k - 1) % RING], ring[k % RING]
    row["q"] = before["q"] + q
    row["q2"] = before["q2"] + q * q
    row["normal"] = before["normal"] + normal
    row["fx"] = before["fx"] + fx
    row["fy"] = before["fy"] + fy
    _add_motion(drop, before, row, k)
    drop["block"], drop["count"] = k, count
    short = mean_q(ring, k, min(count, LEVEL))
    drop["smooth"] += (q - drop["smooth"]) * dt / (QUICK_S + dt)
    drop["top"] = max(short, drop["top"] + (short - drop["top"]) * dt / (RECENT_S + dt))
    if is_closing(ring, k, count):  # a contact that is just made carries little by much friction
        drop["carried"], drop["swing"], drop["crest"], drop["trough"] = drop["smooth"], 0.0, short, short
    elif not drop["sliding"]:
        drop["carried"] = max(drop["carried"], drop["smooth"])
    row["top"], row["carried"] = drop["top"], drop["carried"]
    drop["seen"] += ((1.0 if gap > 0 else 0.0) - drop["seen"]) * max(dt / (MEMORY_S + dt), 1.0 / count)
    if gap > 0:
        _measure_noise(drop, ring, k, count, dt, gap)
        drop["gap"] = gap
    row["rough"] = drop["rough"]
    if not drop["sliding"]:
        _follow_swings(drop, short, dt)
    row["swing"] = drop["swing"]


@compiled_part
def _add_motion(drop: Row, before: Row, row: Row, k: int) -> None:
    """Add the motion of the arm to the sums of block ``k``; where it is unknown, the sums restart at 0."""
    if math.isnan(drop["gx"]):
        row["gx"], row["gy"], row["turn"], drop["unfelt"] = 0.0, 0.0, 0.0, k
    else:
        row["gx"], row["gy"] = before["gx"] + drop["gx"], before["gy"] + drop["gy"]
        row["turn"] = before["turn"] + drop["turn"]


@compiled_part
def _follow_swings(drop: Row, short: float, dt: float) -> None:
    """Follow the largest fall from which q came back by half."""
    drop["swing"] -= drop["swing"] * dt / (MEMORY_S + dt)
    if short >= drop["crest"]:
        drop["crest"], drop["trough"] = short, short
        return
    drop["crest"] += (short - drop["crest"]) * dt / (RECENT_S + dt)  # a slow fall is no swing
    drop["trough"] = min(drop["trough"], short)
    depth = drop["crest"] - drop["trough"]
    if short > drop["trough"] + 0.5 * depth:
        drop["swing"] = max(drop["swing"], depth)
        drop["crest"], drop["trough"] = short, short


@compiled_part
def _measure_noise(drop: Row, ring: Rows, k: int, count: int, dt: float, gap: int) -> None:
    """Follow the deviation of blocks from their neighbours, and that of means of LEVEL blocks from theirs.

    Second differences leave out a steady course. White noise is less in the means; what is not is coloured noise, a
    vibration, or a swing.
    """
    if count < 8:
        return
    least, known = dt / (MEMORY_S + dt), float(count - LEVEL)
    second = _second_difference(ring, k, gap, min(drop["gap"], count - gap - 1))
    white = max(drop["white"], 0.5 * drop["std"])
    drop["white"] += (min(SECOND * second, STDS * white) - drop["white"]) * max(least, 1.0 / (known + 1.0))
    if count < 3 * LEVEL:
        return
    second = abs(mean_q(ring, k, LEVEL) - 2.0 * mean_q(ring, k - LEVEL, LEVEL) + mean_q(ring, k - 2 * LEVEL, LEVEL))
    rough = max(drop["rough"], 0.5 * drop["std"] / math.sqrt(LEVEL))
    share = max(least, 1.0 / (known - 2.0 * LEVEL + 1.0))
    drop["rough"] += (min(SECOND * second, STDS * rough) - drop["rough"]) * share


@compiled_part
def _second_difference(ring: Rows, k: int, gap: int, earlier: int) -> float:
    """Return the size of the second difference of the last three blocks with readings.

    Where they are unequally far apart, it is scaled so that white noise has the same deviation in it.

    Args:
        ring: Blocks.
        k: The last of the three.
        gap: Blocks from the second to it.
        earlier: Blocks from the first to the second.
    """
    first, second, third = mean_q(ring, k - gap - earlier, 1), mean_q(ring, k - gap, 1), mean_q(ring, k, 1)
    if gap == 1 and earlier == 1:
        return abs(third - 2.0 * second + first)
    one, other = gap / (gap + earlier), earlier / (gap + earlier)
    return abs(second - one * first - other * third) * math.sqrt(6.0 / (1.0 + one * one + other * other))


@compiled_part
def mean_q(ring: Rows, end: int, count: int) -> float:
    """Return the mean q of the blocks up to ``end``."""
    total: float = ring[end % RING]["q"] - ring[(end - count) % RING]["q"]
    return total / count


@compiled_part
def mean_normal(ring: Rows, end: int, count: int) -> float:
    """Return the mean normal force of the blocks up to ``end``."""
    total: float = ring[end % RING]["normal"] - ring[(end - count) % RING]["normal"]
    return total / count


@compiled_part
def mean_force(ring: Rows, end: int, count: int) -> tuple[float, float]:
    """Return the mean tangential force of the blocks up to ``end``, N."""
    last, first = ring[end % RING], ring[(end - count) % RING]
    return (last["fx"] - first["fx"]) / count, (last["fy"] - first["fy"]) / count


@compiled_part
def vibration(drop: Row, rough: float) -> float:
    """Return the deviation of what does not average out like white noise."""
    return math.sqrt(max(rough * rough - 1.5 / LEVEL * noise_of(drop) ** 2, 0.0))


@compiled_part
def is_closing(ring: Rows, end: int, count: int) -> bool:
    """Return whether the normal force grew as that of a grip that closes, within the last of ``count`` blocks."""
    few, back = min(count, 3), min(count, LENGTHS[-1])
    return mean_normal(ring, end, few) > (1.0 + CHANGES) * mean_normal(ring, end - back + few, few)


@compiled_part
def grows_tighter(ring: Rows, k: int, p: int, top: int, b: int, fall: float) -> bool:
    """Return whether the grip grew tighter meanwhile, which explains a fall of q or a part of it.

    Args:
        ring: Blocks.
        k: The newest.
        p: Newest blocks, after the fall.
        top: The last block before it.
        b: Blocks up to that one.
        fall: The fall, as a part of the peak.
    """
    return mean_normal(ring, k, p) > (1.0 + TIGHTER * fall) * mean_normal(ring, top, b)


@compiled_part
def noise_of(drop: Row) -> float:
    """Return the deviation of q of a block: what is stated, or measured where that is more.

    Blocks without readings make a mean no more certain. Where there are some, the deviation is larger accordingly.
    """
    return max(float(drop["std"]), float(drop["white"])) / math.sqrt(drop["seen"])


@compiled_part
def goes_aside(ring: Rows, k: int, p: int, top: int, b: int) -> bool:
    """Return whether the tangential force changed across its own direction more than along it."""
    fx, fy = mean_force(ring, top, b)
    fx_now, fy_now = mean_force(ring, k, p)
    size, dx, dy = math.hypot(fx, fy), fx_now - fx, fy_now - fy
    along, across = -(dx * fx + dy * fy), abs(dx * fy - dy * fx)
    return size > 0.0 and across > MOSTLY * max(along, 0.1 * size * size)
