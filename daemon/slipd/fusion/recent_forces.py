"""The forces of the recent past: the range of the normal force since the newest image, and the last wrenches."""

from __future__ import annotations

import numpy as np

from slipd.fusion.compiled import compiled, compiled_part
from slipd.fusion.rows import PASTS, Row, Rows

PAST_NS = 1_000_000
"""One reading in this time is kept."""


@compiled_part
def keep_force(forces: Row, t_ns: int, wrench: Row) -> None:
    """Add a force to the range since the newest image, and to those of the recent past."""
    forces["low_n"], forces["high_n"] = min(forces["low_n"], -wrench[2]), max(forces["high_n"], -wrench[2])
    past, count = forces["past"], forces["count"]
    if count > 0 and t_ns - past[(count - 1) % PASTS]["t_ns"] < PAST_NS:
        return
    kept = past[count % PASTS]
    kept["t_ns"], forces["count"] = t_ns, count + 1
    for i in range(6):
        kept["wrench"][i] = wrench[i]


@compiled
def begin_range(states: Rows, normal_n: float) -> float:
    """Return the range of the normal force so far, N, and begin another one with its value now."""
    forces = states[0]["forces"]
    range_n: float = forces["high_n"] - forces["low_n"]
    forces["low_n"], forces["high_n"] = normal_n, normal_n
    return range_n


@compiled
def mean_wrench(states: Rows, since_ns: int, until_ns: int) -> tuple[float, float, float, float, float, float]:
    """Return the mean wrench of the kept readings between two times; there must be a reading.

    If no reading is kept of that interval, this is the wrench of the reading nearest to its end.

    Args:
        states: One row of CONTACT_STATE.
        since_ns: CLOCK_MONOTONIC; a reading of this time does not count.
        until_ns: Likewise; a reading of this time counts.

    Returns:
        Force and torque in the pad frame, N and N·m.
    """
    past, newest = states[0]["forces"]["past"], states[0]["forces"]["count"] - 1
    total, found, oldest = np.zeros(6), 0, max(newest + 1 - PASTS, 0)
    for k in range(newest, oldest - 1, -1):
        kept = past[k % PASTS]
        if kept["t_ns"] <= since_ns:
            break
        if kept["t_ns"] <= until_ns:
            found += 1
            for i in range(6):
                total[i] += kept["wrench"][i]
    if found == 0:
        at, away_ns = newest, abs(past[newest % PASTS]["t_ns"] - until_ns)
        while at > oldest and abs(past[(at - 1) % PASTS]["t_ns"] - until_ns) <= away_ns:
            at -= 1
            away_ns = abs(past[at % PASTS]["t_ns"] - until_ns)
        for i in range(6):  # a slice takes seconds to compile
            total[i] = past[at % PASTS]["wrench"][i]
    share = 1.0 / max(found, 1)
    fx, fy, fz, mx, my, mz = total[0], total[1], total[2], total[3], total[4], total[5]
    return share * fx, share * fy, share * fz, share * mx, share * my, share * mz
