"""A load that falls from static to dynamic friction, reading by reading."""

from __future__ import annotations

from slipd.fusion.compiled import compiled
from slipd.fusion.rows import Rows


@compiled
def fell(window: Rows, watch: Rows, which: int, t_s: float, load: float, ratio: float, used: float) -> bool:
    """Add a reading to a window and return whether load and ratio fell within it; a fall forgets all before.

    Args:
        window: Ring of rows of WINDOW.
        watch: Settings, and where each ring begins and how many readings it holds.
        which: The ring: 0 of force, 1 of spin.
        t_s: Time of the reading, s.
        load: Tangential force, N, or spin torque, N·m.
        ratio: Load over normal force.
        used: Utilisation; NaN where the reading arms no fall.

    Source: paper, after eq. (4): R drops from the static to the dynamic coefficient.
    """
    size, kept, armed_at = len(window), watch["kept"], watch["armed_at"]
    first, count = watch["first"], watch["count"]
    while count[which] > 0 and window[first[which]]["t_s"] < t_s - watch["window_s"]:
        first[which] = (first[which] + 1) % size
        count[which] -= 1
    fell = False
    at = first[which]
    for _k in range(count[which]):
        before = window[at]
        if before["utilisation"] >= armed_at and load <= kept * before["load"] and ratio <= kept * before["ratio"]:
            fell = True
            break
        at += 1
        if at == size:
            at = 0
    end = (first[which] + count[which]) % size
    row = window[end]
    row["t_s"], row["load"], row["ratio"], row["utilisation"] = t_s, load, ratio, used
    if fell:
        first[which], count[which] = end, 0
    count[which] += 1
    return fell
