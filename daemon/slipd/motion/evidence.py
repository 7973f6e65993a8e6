"""Evidence that the object moves on the pad, and the one rule that combines all kinds of it against a stated risk.

Every kind of evidence states a surprise, −ln of the probability of its statistic without motion, and how often it
looks. Noise alone exceeds a surprise of ln(looks an hour / false alarms an hour) as often as the risk allows. Kinds
that look within a short time of each other are combined: the sum of n independent surprises is gamma distributed
(Fisher's method), so weak evidence of two kinds counts as much as strong evidence of one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import betainc

from slipd.fusion.friction_learning import GAP_S
from slipd.types.arrays import Array

EVIDENCE = ("load_drop", "image_change", "width", "external")
"""Kinds of evidence, by their bit in ``evidence`` of `slipd.fusion.rows.ASSESSMENT`.

- load_drop: The load falls from static to dynamic friction, or exceeds what any friction carries.
- image_change: The shares of the taxels change at unchanged load.
- width: The width of the gripper changes at unchanged grip force.
- external: A driver of the user reports it.
"""
MOST_SURPRISE = 700.0
"""No surprise is larger: its probability is no floating-point number."""
BLOCK_S = 0.05
"""Duration of a block of images, s: a contact that creeps with 3 mm/s moves 0.15 mm in it."""
TOGETHER_NS = round(1e9 * BLOCK_S)
"""Evidence within this time of each other may show the same motion."""
LASTS_NS = 200_000_000
"""What lasts for this time is no swing: a contact or hold settles in it, and a width must differ for so long."""
REPORTED_NS = round(1e9 * GAP_S)
"""Motion stays reported for at least this time after the last evidence."""
SAME_SHARE = 0.1
"""Normal forces are the same within this share, and so are tangential forces."""
REFERENCE = 16
"""Readings at the beginning of a hold that show its noise."""
LEAST_READINGS = 3
"""Fewer readings show neither a scatter nor that all of them differ."""
LEAST_STD_M = 1e-6
"""Noise of a place or a width is taken as no smaller, m: without noise, or in coarse counts, it is hidden."""
LONG_STEP = 4
"""Steps over which a random walk is told from white noise."""


class Evidence(NamedTuple):
    """One piece of evidence that the object moves.

    Attributes:
        kind: A word of EVIDENCE.
        t_ns: When it was found, CLOCK_MONOTONIC.
        surprise: −ln of the probability of a statistic this large without motion.
    """

    kind: str
    t_ns: int
    surprise: float


def evidence_mask(*kinds: str) -> int:
    """Return the bits of some kinds of evidence."""
    return sum(1 << EVIDENCE.index(kind) for kind in set(kinds))


@cache
def evidence_names(mask: int) -> tuple[str, ...]:
    """Return the kinds of evidence in a bit mask, in the order of EVIDENCE."""
    return tuple(kind for bit, kind in enumerate(EVIDENCE) if mask >> bit & 1)


def f_surprise(ratio: float, terms: float, freedom: float) -> float:
    """Return the surprise of a ratio of F(terms, freedom); 0 where a number is NaN, which is no evidence.

    Args:
        ratio: Mean square of ``terms`` values over a variance that was measured.
        terms: Their number.
        freedom: Degrees of freedom of the measured variance.
    """
    tail = float(betainc(0.5 * freedom, 0.5 * terms, freedom / (freedom + terms * ratio)))
    if math.isnan(tail):
        return 0.0
    return -math.log(tail) if tail > math.exp(-MOST_SURPRISE) else MOST_SURPRISE


def combined_surprise(surprises: list[float]) -> float:
    """Return −ln of the probability that the sum of as many independent surprises is as large.

    Source: Fisher's method; the sum of n standard exponential variables exceeds s with probability
    exp(−s) Σ_{j<n} s^j / j!.
    """
    total = sum(surprises)
    return total - math.log(sum(total**j / math.factorial(j) for j in range(len(surprises))))


def walk_variance(short: Array, longer: Array, count: int) -> Array:
    """Return the variance of a step of the random walk of which noise may consist.

    Steps over h values have the variance 2 w + h d for white noise of variance w and a walk of variance d. Until the
    longer steps are many enough, all noise counts as a walk.

    Args:
        short: Variance of a step, 2 w + d.
        longer: Likewise over `LONG_STEP` values.
        count: Number of the longer steps.
    """
    if count <= LONG_STEP:
        return short
    doubt = 1.0 + 1.5 * math.sqrt(LONG_STEP / count)
    walk: Array = np.minimum(np.maximum(doubt * longer - short, 0.0) / (LONG_STEP - 1), short)
    return walk


class MotionRisk:
    """Decides whether the object moves, from all kinds of evidence of one contact or grasp.

    Args:
        false_alarms_per_hour: How often noise alone may be reported as motion, 1/h.
        looks_per_hour: How many independent looks each kind in use takes in an hour. The risk is shared equally among
            the kinds, at least one, and with their combination where there are several.
    """

    def __init__(self, false_alarms_per_hour: float, looks_per_hour: Mapping[str, float]) -> None:
        share = false_alarms_per_hour / (len(looks_per_hour) + (len(looks_per_hour) > 1))
        self._single = {kind: max(math.log(looks / share), 0.0) for kind, looks in looks_per_hour.items()}
        self._combined = max(self._single.values())
        self._newest: dict[str, Evidence] = {}

    def update(self, evidence: Evidence, belief: float = 0.0) -> tuple[str, ...]:
        """Add one piece of evidence; a surprise or a belief that is NaN shows nothing.

        Args:
            evidence: Of a kind in use; it replaces the one before of its kind.
            belief: What else is known of the odds of motion, in nats; 0: nothing. See `slipd.grasp.pad_motion`.

        Returns:
            The kinds that together show motion, in the order of EVIDENCE; empty where they do not.
        """
        self._newest[evidence.kind] = evidence
        if evidence.surprise + belief >= self._single[evidence.kind]:
            return (evidence.kind,)
        since_ns = evidence.t_ns - TOGETHER_NS
        together = {
            kind: found.surprise
            for kind, found in self._newest.items()
            if found.t_ns >= since_ns and found.surprise > 0.0
        }
        if len(together) > 1 and combined_surprise(list(together.values())) + belief >= self._combined:
            return tuple(sorted(together, key=EVIDENCE.index))
        return ()
