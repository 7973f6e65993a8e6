"""Fit the line beneath delayed readings: the least delayed ones show the clock, whatever the others do.

The line is the edge of the points' lower convex hull with the least sum of delays (Zhang, Liu and Xia, "Clock
synchronization algorithms for network measurements", INFOCOM 2002); newer points weigh more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from operator import mul

MAX_PPM = 1_000.0
"""Largest rate error of a clock, ppm: twice that of crystals in use."""
SLICES = 64
"""Number of slices that are fitted (8 s without gaps): long enough to resolve some ppm, short compared to warming."""
FADE = 0.97
"""Weight of a slice relative to the next one: a changed rate is followed within seconds."""
LEAST_BOUND_NS = 20_000
"""Least bound: the wake-up time varies by this much, however even the readings look."""
BOUND_FACTOR = 4.0
"""Bound relative to the mean delay of the kept readings; measured on the delays in docs/time.md."""
FEW = 4.0
"""Number of slices at which the bound doubles, because the mean delay is not known well."""
WANDER = 1e-6
"""Largest change of a crystal's rate during a stall."""
STEP_SLICES, STEP_NS = 6, 500_000
"""This many slices with an equal delay of at least this much are a backward step of less than a period."""
RATE_FACTOR, RATE_SLACK_NS = 6.0, 4_000_000
"""Tolerance of the rate limit: this factor times mean delay, plus the slack, over the length."""

_WEIGHTS = [FADE**age for age in reversed(range(SLICES))]


@dataclass(frozen=True, slots=True)
class Line:
    """Receipt of an undelayed reading: device time + lag + slope · (device time − at).

    Attributes:
        at_ns: Device time of the newest point.
        lag_ns: Receipt minus device time at that point.
        slope: Host seconds per device second, minus one.
        bound_ns: Bound on the line's error at ``at_ns``.
        rate_bound: Bound on the slope's error.
        stepped_ns: Step back of the clock, shown by equal delays of the newest slices; 0 if there is none.
    """

    at_ns: int
    lag_ns: int
    slope: float
    bound_ns: float
    rate_bound: float
    stepped_ns: float


def lowest_line(points: Sequence[tuple[int, int]]) -> Line | None:
    """Return the line beneath points (device time, lag) in rising time; None if no clock runs like that."""
    at_ns, lag_ns = points[-1]
    x = [float(point[0] - at_ns) for point in points]
    y = [float(point[1] - lag_ns) for point in points]
    length = -x[0]
    if length <= 0.0:
        return None
    slope, least = _edge(x, y)
    most = MAX_PPM * 1e-6
    if abs(slope) > most:
        mean = sum(y) / len(y) - slope * sum(x) / len(x) - least
        if abs(slope) > most + (RATE_FACTOR * mean + RATE_SLACK_NS) / length:
            return None
        slope = math.copysign(most, slope)
        least = min(b - slope * a for a, b in zip(x, y, strict=True))
    late = [b - slope * a - least for a, b in zip(x, y, strict=True)]
    mean = sum(late) / len(late)
    bound = LEAST_BOUND_NS + BOUND_FACTOR * (1.0 + FEW / len(late)) * max(mean, min(late[-2:]))
    newest = late[-STEP_SLICES:]
    before = sum(late[:-STEP_SLICES]) / max(1, len(late) - STEP_SLICES)
    low = min(newest)
    stepped = len(late) > STEP_SLICES and low > STEP_NS + 4.0 * before and max(newest) < 1.5 * low
    return Line(
        at_ns, lag_ns + round(least), slope, bound, BOUND_FACTOR * mean / length + WANDER, low if stepped else 0.0
    )


def _edge(x: list[float], y: list[float]) -> tuple[float, float]:
    """Return slope and height at x = 0 of the lower hull's edge beneath the weighted middle of the points."""
    hull: list[tuple[float, float]] = []
    for c, d in zip(x, y, strict=True):
        while len(hull) > 1 and (hull[-1][0] - hull[-2][0]) * (d - hull[-2][1]) <= (hull[-1][1] - hull[-2][1]) * (
            c - hull[-2][0]
        ):
            hull.pop()
        hull.append((c, d))
    weights = _WEIGHTS[-len(x) :]
    middle = sum(map(mul, weights, x)) / sum(weights)
    (a, b), (c, d) = next(edge for edge in pairwise(hull) if edge[1][0] >= middle)
    slope = (d - b) / (c - a)
    return slope, b - slope * a
