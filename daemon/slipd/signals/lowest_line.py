"""The line beneath readings that came late: the least late tell of the clock, whatever the others do.

The line is the edge of the points' lower convex hull that leaves the least sum of lateness (Zhang, Liu and Xia,
"Clock synchronization algorithms for network measurements", INFOCOM 2002), the newer points weighing more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from operator import mul

#: Largest rate error of a clock, ppm: twice what crystals in use have.
MAX_PPM = 1_000.0
#: The line is laid under so many slices (8 s without gaps): long enough to know some ppm, short against warming.
SLICES = 64
#: Weight of a slice over that of the one after it: a changed rate is followed within some seconds.
FADE = 0.97
#: Least bound: by so much waking up varies, however even the readings look.
LEAST_BOUND_NS = 20_000
#: Bound over the mean lateness of the kept readings; measured over the delays of the report.
BOUND_FACTOR = 4.0
#: Slices at which too few to know the mean lateness double the bound.
FEW = 4.0
#: A crystal's rate changes by so much within a stall, at most.
WANDER = 1e-6
#: So many slices that all came late alike, by this at least, are a step back of less than a period.
STEP_SLICES, STEP_NS = 6, 500_000
#: A rate is out of bounds by more than the noise from so many times mean lateness over length.
RATE_FACTOR, RATE_SLACK_NS = 6.0, 4_000_000

_WEIGHTS = [FADE**age for age in reversed(range(SLICES))]


@dataclass(frozen=True, slots=True)
class Line:
    """The receipt of a reading that is not late: device time + lag + slope · (device time − at).

    Attributes:
        at_ns: Device time of the newest point.
        lag_ns: Receipt less device time there.
        slope: Host seconds a device second, less one.
        bound_ns: Bound on the line's error at ``at_ns``.
        rate_bound: Bound on the slope's error.
        stepped_ns: By so much the newest slices are late all alike: the clock was set back so far; 0 where not.
    """

    at_ns: int
    lag_ns: int
    slope: float
    bound_ns: float
    rate_bound: float
    stepped_ns: float


def lowest_line(points: Sequence[tuple[int, int]]) -> Line | None:
    """The line beneath points of device time and lag, time rising; None where no clock runs like that."""
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
    """Slope, and height at x = 0, of the lower hull's edge beneath the points' weighted middle."""
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
