"""The step of a contact's level that its utilisation asks for, in compiled code: noise, hysteresis and dwell.

- A reading counts as much as its noise allows (`settle`). Where a grip has just begun to close, one or two taxels feel
  it and the noise of the torque alone may ask for more friction than there is; a single such reading is no danger.
- A step is left only after a while, and by more than noise (`held_step`).
"""

from __future__ import annotations

import math

from slipd.fusion.compiled import compiled_part
from slipd.fusion.rows import Row
from slipd.fusion.verdict_numbers import relative_noise

DWELL_S = 0.25
"""A level is left only after the load stayed a hysteresis below its threshold for this time, s: the period of the
slowest vibration of arms and tools (some 5 Hz), and less than what a person or a program waits for."""
SURE = 0.05
"""A reading whose utilisation has this standard deviation by noise, or less, counts fully."""
CERTAIN_STDS = 4.0
"""No noise explains what exceeds so many of its standard deviations: a utilisation counts at once as far as it does."""
LARGE = 2.0
"""A utilisation that does not count fully counts as no more than this."""


@compiled_part
def settle(row: Row, conditions: Row, memory: Row, used: float, measured: float, exact: bool) -> float:
    """Return the utilisation that counts: that of the reading, or of a mean where the noise is large.

    The mean moves towards each reading by (SURE / σ)², so that its own deviation stays below SURE. What exceeds
    CERTAIN_STDS σ does not wait for it. σ is that by noise alone: no mean makes an unknown load smaller.

    Args:
        row: The reading, with its contact and utilisation.
        conditions: Conditions in force.
        memory: Its ``settled`` is updated.
        used: Utilisation of the reading, with what the unknown load may add.
        measured: Without that.
        exact: It is that of force and spin together.
    """
    contact = row["contact"]
    if exact:
        vx, vy, omega = row["utilisation"]["twist"]
        force, about = (contact["fx_n"], contact["fy_n"]), (contact["cx_m"], contact["cy_m"])
        stds = conditions["force_std_n"], conditions["torque_std_nm"]
        noise = relative_noise(force, contact["spin_nm"], about, (vx, vy, omega), stds[0], stds[1])
    else:
        ratio, force_std = contact["friction_ratio"], conditions["force_std_n"]
        noise = force_std * math.hypot(1.0, ratio) / (contact["normal_n"] * ratio) if ratio > 0.0 else 0.0
    std = min(measured, LARGE) * noise
    before = memory["settled"]
    memory["settled"] = min(used, LARGE)
    if not std > SURE:
        return used
    memory["settled"] = before + (min(used, LARGE) - before) * (SURE / std) ** 2
    return max(float(memory["settled"]), min(used, LARGE) - CERTAIN_STDS * std)


@compiled_part
def held_step(used: float, conditions: Row, memory: Row, warning: float, width: float, t_s: float) -> int:
    """Return the step of a utilisation; a higher one is reached at once, a lower one only after DWELL_S.

    Args:
        used: Utilisation; infinity exceeds every threshold.
        conditions: Conditions in force.
        memory: Its ``step`` and ``held_s`` are updated.
        warning: Where WARNING begins now; it ends ``width`` below the configured threshold.
        width: Hysteresis.
        t_s: Now, s.
    """
    held_s = memory["held_s"]
    if used >= conditions["caution"] - width:
        held_s[0] = t_s
    if used >= conditions["warning"] - width:
        held_s[1] = t_s
    reached = int(used >= conditions["caution"]) + int(used >= warning)
    while reached < memory["step"] and t_s - held_s[reached] < DWELL_S:
        reached += 1
    memory["step"] = reached
    return reached
