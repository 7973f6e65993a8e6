"""The one rule that combines evidence of motion: how improbable it is without motion, against a stated risk.

Every kind of evidence states a surprise, −ln of the probability of its statistic without motion, and how often it
looks. Noise alone exceeds a surprise of ln(looks an hour / false alarms an hour) as often as the risk allows. Kinds
that look within a short time of each other are combined: the sum of n independent surprises is gamma distributed
(Fisher's method), so weak evidence of two kinds counts as much as strong evidence of one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from slipd.motion.evidence import EVIDENCE, Evidence

TOGETHER_NS = 50_000_000
"""Evidence within this time of each other may show the same motion."""


class MotionRisk:
    """Decides whether the object moves, from all kinds of evidence of one contact or grasp.

    Args:
        false_alarms_per_hour: How often noise alone may be reported as motion, 1/h.
        looks_per_hour: How many independent looks each kind in use takes in an hour. The risk is shared equally among
            the kinds, and with their combination where there are several.

    Raises:
        ValueError: A kind is unknown, or a number is not positive.
    """

    def __init__(self, false_alarms_per_hour: float, looks_per_hour: Mapping[str, float]) -> None:
        if unknown := sorted(looks_per_hour.keys() - set(EVIDENCE)):
            raise ValueError(f"kinds of evidence must be among {EVIDENCE}, got {unknown}")
        if not (looks_per_hour and false_alarms_per_hour > 0.0 and min(looks_per_hour.values()) > 0.0):
            raise ValueError("false_alarms_per_hour and looks_per_hour must be positive")
        shares = len(looks_per_hour) + (len(looks_per_hour) > 1)
        share = false_alarms_per_hour / shares
        self._single = {kind: max(math.log(looks / share), 0.0) for kind, looks in looks_per_hour.items()}
        self._combined = max(self._single.values())
        self._newest: dict[str, Evidence] = {}

    def update(self, evidence: Evidence, belief: float = 0.0) -> tuple[str, ...]:
        """Add one piece of evidence.

        Args:
            evidence: Of a kind in use; it replaces the one before of its kind.
            belief: What else is known of the odds of motion, in nats; 0: nothing. See `slipd.motion.load_belief`.

        Returns:
            The kinds that together show motion, in the order of EVIDENCE; empty where they do not.
        """
        self._newest[evidence.kind] = evidence
        alone = evidence.surprise + belief
        if alone >= self._single[evidence.kind]:
            return (evidence.kind,)
        since_ns = evidence.t_ns - TOGETHER_NS
        together = [found for found in self._newest.values() if found.t_ns >= since_ns and found.surprise > 0.0]
        if len(together) < 2 or combined_surprise([found.surprise for found in together]) + belief < self._combined:
            return ()
        return tuple(sorted((found.kind for found in together), key=EVIDENCE.index))


def combined_surprise(surprises: list[float]) -> float:
    """Return −ln of the probability that the sum of as many independent surprises is as large.

    Source: Fisher's method; the sum of n standard exponential variables exceeds s with probability
    exp(−s) Σ_{j<n} s^j / j!.
    """
    total, term, terms = sum(surprises), 1.0, 0.0
    for j in range(len(surprises)):
        terms += term
        term *= total / (j + 1)
    return total - math.log(terms)
