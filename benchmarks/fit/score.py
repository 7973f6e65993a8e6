"""Score what a detector reports on kept grasps: slips by the way the object slid, and false reports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from fit.record import Grasp
from numpy.typing import NDArray

from slipd.types.arrays import Array
from slipd_client.messages import level_code

CREEPS = ("creep", "flat creep")
RATIO = (0.7, 0.92)
"""μ_d / μ_s of the slips that are scored."""
LIMITS_M = (0.001, 0.002, 0.005)
EARLY_S, LATE_S = 0.02, 0.25
"""As `evaluate.score`: a report is false if it begins neither in a slip nor so close to one."""
Counts = NDArray[np.int64]
Spans = Sequence[tuple[float, float]]
"""Begin and end of each time in which slip is reported, s."""


@dataclass
class Score:
    """Counts of some grasps.

    Attributes:
        reached: How many slips went each of `LIMITS_M`.
        reported: How many of those were reported by then.
        grasps: Grasps.
        false: Grasps with a false report.
        missed: Slips of 10 mm and more that were never reported, and all of those.
    """

    reached: Counts = field(default_factory=lambda: np.zeros(len(LIMITS_M), np.int64))
    reported: Counts = field(default_factory=lambda: np.zeros(len(LIMITS_M), np.int64))
    grasps: int = 0
    false: int = 0
    far: int = 0
    never: int = 0

    def __add__(self, other: Score) -> Score:
        return Score(
            self.reached + other.reached, self.reported + other.reported, self.grasps + other.grasps,
            self.false + other.false, self.far + other.far, self.never + other.never,
        )  # fmt: skip


def spans_of(t_s: Array, slips: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Return when a flag is up."""
    if len(t_s) == 0:
        return []
    edges = np.diff(np.asarray(slips, np.int8), prepend=0, append=0)
    ends = np.append(t_s, t_s[-1])
    return [
        (float(t_s[a]), float(ends[b]))
        for a, b in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True)
    ]


def today(grasp: Grasp) -> list[tuple[float, float]]:
    """Return when the recorded run reported slip."""
    return spans_of(grasp.level[:, 0], grasp.level[:, 1] == level_code("slipping"))


def score(grasp: Grasp, spans: Spans) -> Score:
    """Score one grasp."""
    found = Score(grasps=1)
    episodes = grasp.episodes
    for begin, _ in spans:
        if not any(a - EARLY_S <= begin <= b + LATE_S for a, b in episodes):
            found.false = 1
    if not RATIO[0] <= grasp.ratio <= RATIO[1]:
        return found
    t_s, way = grasp.truth[:, 0], grasp.way_m
    for a, b in episodes:
        start, end = np.interp((a, b), t_s, way)
        first = min((max(begin, a) for begin, until in spans if begin <= b and until > a), default=np.inf)
        went = np.interp(first, t_s, way) - start if first < np.inf else np.inf
        for k, limit in enumerate(LIMITS_M):
            if end - start >= limit:
                found.reached[k] += 1
                found.reported[k] += went <= limit
        if end - start >= 0.01:
            found.far += 1
            found.never += first == np.inf
    return found
