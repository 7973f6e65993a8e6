"""The step of a contact's level that its utilisation asks for, in compiled code: noise, growth, hysteresis, dwell.

- A reading counts as much as its noise allows (`settle`). Where a grip has just begun to close, one or two taxels feel
  it and the noise of the torque alone may ask for more friction than there is; a single such reading is no danger.
- A load that grows steadily reaches WARNING a hysteresis earlier (`grows`): it will be there soon, and what prevents a
  slip is time, not load.
- A step is left only after a while, and by more than noise (`held_step`).
"""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled
from slipd.fusion.load_blocks import LEVEL, mean_q
from slipd.fusion.load_noise import relative_noise
from slipd.fusion.rows import Row, Rows

DWELL_S = 0.25
"""A level is left only after the load stayed a hysteresis below its threshold for this time, s: the period of the
slowest vibration of arms and tools (some 5 Hz), and less than what a person or a program waits for."""
SURE = 0.05
"""A reading whose utilisation has this standard deviation by noise, or less, counts fully."""
CERTAIN = 4.0
"""A utilisation counts at once as far as it exceeds so many standard deviations: no noise explains that."""
LARGE = 2.0
"""A utilisation that does not count fully counts as no more than this."""
GROWTH_S = 0.2
"""The growth of a load is that in this time, s."""
PARTS = 4
"""It is looked at in so many parts of this time: a load that jumped did not grow in each of them,"""
STEADY = 0.25
"""by at least this part of an equal share."""
GROWTH_PER_S = 0.15
"""A load grows from this much utilisation a second on: it would be near the limit within a second."""
GROWTH_STDS = 6.0
"""Its growth is more than this many standard deviations of measured noise."""


@compiled
def settle(row: Row, watch: Row, used: float, measured: float, exact: bool) -> float:
    """Return the utilisation that counts: that of the reading, or of a mean where the noise is large.

    The mean moves towards each reading by (SURE / σ)², so that its own deviation stays below SURE. What exceeds CERTAIN
    σ does not wait for it. σ is that by noise alone: no mean makes an unknown load smaller.

    Args:
        row: The reading, with its contact and utilisation.
        watch: Its ``settled`` is updated.
        used: Utilisation of the reading, with what the unknown load may add.
        measured: Without that.
        exact: It is that of force and spin together.
    """
    contact = row["contact"]
    if exact:
        vx, vy, omega = row["utilisation"]["twist"]
        force, about = (contact["fx_n"], contact["fy_n"]), (contact["cx_m"], contact["cy_m"])
        stds = watch["force_std_n"], watch["torque_std_nm"]
        noise = relative_noise(force, contact["spin_nm"], about, (vx, vy, omega), stds[0], stds[1])
    else:
        ratio, force_std = contact["friction_ratio"], watch["force_std_n"]
        noise = force_std * math.hypot(1.0, ratio) / (contact["normal_n"] * ratio) if ratio > 0.0 else 0.0
    std = min(measured, LARGE) * noise
    before = watch["settled"]
    watch["settled"] = min(used, LARGE)
    if not std > SURE:
        return used
    watch["settled"] = before + (min(used, LARGE) - before) * (SURE / std) ** 2
    return max(float(watch["settled"]), min(used, LARGE) - CERTAIN * std)


@compiled
def grows(drop: Row, ring: Rows, mu: float, least: float) -> bool:
    """Return whether the load grows steadily, beyond its noise, and so fast that it would soon be near the limit.

    Args:
        drop: What is known of the load, a row of DROP.
        ring: Rows of BLOCK, shape (RING,).
        mu: Coefficient of static friction.
        least: Utilisation that the load has at least, as a mean of some milliseconds.
    """
    dt, last = drop["dt"], drop["block"]
    part = round(GROWTH_S / PARTS / dt) if dt > 0.0 else 0
    few = min(LEVEL, max(part // 5, 1))
    if part == 0 or drop["count"] < PARTS * part + few:
        return False
    newest = mean_q(ring, last, few)
    growth = newest - mean_q(ring, last - PARTS * part, few)
    if newest < least * mu or growth < max(GROWTH_PER_S * GROWTH_S * mu, GROWTH_STDS * drop["rough"]):
        return False
    for k in range(1, PARTS + 1):
        before = mean_q(ring, last - k * part, few)
        if newest - before < STEADY * growth / PARTS:
            return False
        newest = before
    return True


@compiled
def held_step(used: float, step: int, watch: Row, warning: float, width: float, t_s: float) -> int:
    """Return the step of a utilisation; a higher one is reached at once, a lower one only after DWELL_S.

    Args:
        used: Utilisation; infinity exceeds every threshold.
        step: The step before.
        watch: Its ``held_s`` is updated.
        warning: Where WARNING begins now; it ends ``width`` below the configured threshold.
        width: Hysteresis.
        t_s: Now, s.
    """
    held_s = watch["held_s"]
    if used >= watch["caution"] - width:
        held_s[0] = t_s
    if used >= watch["warning"] - width:
        held_s[1] = t_s
    reached = int(used >= watch["caution"]) + int(used >= warning)
    while reached < step and t_s - held_s[reached] < DWELL_S:
        reached += 1
    return reached
