"""Two jaws that close on a rigid part, or on nothing."""

from __future__ import annotations

import math


def moved_jaws(width: float, goal: float, part: float, reach: float) -> tuple[float, bool, bool]:
    """Return the width between the jaws after a motion, whether they still move, and whether they hold the part.

    Args:
        width: Between the jaws before, in any unit of length.
        goal: Where they go.
        part: Width of the part between them; 0: no part.
        reach: How far they get.
    """
    squeeze = 0.0 < part <= width and goal < part
    stop = part if squeeze else goal
    if abs(stop - width) > reach:
        return width + math.copysign(reach, stop - width), True, False
    return stop, False, squeeze
