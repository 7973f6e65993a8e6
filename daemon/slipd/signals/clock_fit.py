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
MOST_SLOPE = MAX_PPM * 1e-6
SLICES = 64
"""Number of slices that are fitted (8 s without gaps): long enough to resolve some ppm, short compared to warming."""
FADE = 0.97
"""Weight of a slice relative to the next one: a changed rate is followed within seconds."""
LEAST_BOUND_NS = 20_000
"""Least bound: the wake-up time varies by this much, however even the readings look."""
BOUND_FACTOR = 4.0
"""Bound relative to the mean delay of the kept readings; measured on the delays in docs/measured/time.md."""
FEW = 4.0
"""Number of slices at which the bound doubles, because the mean delay is not known well."""
WANDER = 1e-6
"""Largest change of a crystal's rate during a stall."""
RATE_FACTOR, RATE_SLACK_NS = 6.0, 4_000_000
"""Tolerance of the rate limit: this factor times mean delay, plus the slack, over the length."""

OWN_SHARE = 0.75
"""A clock went back if its times per reading fell short by at least this share of the growth in lag."""

Slice = tuple[int, int, int]
"""The least delayed reading of a slice: device time, receipt less device time, readings until then."""

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
    """

    at_ns: int
    lag_ns: int
    slope: float
    bound_ns: float
    rate_bound: float


def lowest_line(points: Sequence[Slice]) -> Line | None:
    """Return the line beneath slices in rising time; None if no clock runs like that.

    The slope exceeds ``MOST_SLOPE`` where the lag grows faster than any clock drifts: clock or line fall behind.
    """
    at_ns, lag_ns = points[-1][:2]
    x = [float(point[0] - at_ns) for point in points]
    y = [float(point[1] - lag_ns) for point in points]
    length = -x[0]
    if length <= 0.0:
        return None
    slope, least = _edge(x, y)
    if abs(slope) > MOST_SLOPE:
        mean = sum(y) / len(y) - slope * sum(x) / len(x) - least
        tolerated = abs(slope) <= MOST_SLOPE + (RATE_FACTOR * mean + RATE_SLACK_NS) / length
        if slope < 0.0 and not tolerated:
            return None
        if tolerated:
            slope = math.copysign(MOST_SLOPE, slope)
            least = min(b - slope * a for a, b in zip(x, y, strict=True))
    late = [b - slope * a - least for a, b in zip(x, y, strict=True)]
    mean = sum(late) / len(late)
    bound = LEAST_BOUND_NS + BOUND_FACTOR * (1.0 + FEW / len(late)) * max(mean, min(late[-2:]))
    return Line(at_ns, lag_ns + round(least), slope, bound, BOUND_FACTOR * mean / length + WANDER)


def period_of_step(slices: Sequence[Slice], late: Slice, late_ns: int) -> float | None:
    """Return whether the device's clock went back between the last of some slices and a late one.

    It did if its time advanced less per reading than before. A delay does not change that; lost readings increase it.

    Returns:
        The device time between two readings, ns; None where the clock shows no step.
    """
    period_ns = min((b[0] - a[0]) / (b[2] - a[2]) for a, b in pairwise(slices))
    own_ns = (late[2] - slices[-1][2]) * period_ns - (late[0] - slices[-1][0])
    return period_ns if own_ns >= OWN_SHARE * late_ns else None


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
