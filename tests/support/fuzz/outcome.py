"""What a round of fuzzing found, and whether that is within what the device's check allows."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from scipy.special import pdtrik

CONFIDENCE = 0.999
"""A sound check exceeds its bound in one run of a thousand."""


@dataclass
class Outcome:
    """Counts of rounds on one device.

    Attributes:
        amount: Damaged frames, random bytes or cuts that were fed.
        false: Samples whose content was never sent.
        faults: What must not happen, in words.
    """

    amount: int = 0
    false: int = 0
    faults: list[str] = field(default_factory=list)


def allowed(amount: int, probability: float) -> int:
    """Return how many false accepts this many trials may show: the Poisson bound."""
    return math.ceil(pdtrik(CONFIDENCE, amount * probability))
