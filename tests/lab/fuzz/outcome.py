"""What a round of fuzzing found, and whether that is within what the device's check allows."""

from __future__ import annotations

from dataclasses import dataclass, field

from scipy.stats import poisson

CONFIDENCE = 0.999
"""A sound check exceeds its bound in one run of a thousand."""


@dataclass
class Outcome:
    """Counts of one or more rounds on one device.

    Attributes:
        device: Its name.
        amount: What was fed: damaged frames, random bytes, or cuts.
        good: Undamaged readings that were fed.
        lost: Those of them that did not come out.
        false: Samples that say what was never sent.
        seconds: Spent feeding.
        faults: What must not happen, in words.
    """

    device: str
    amount: int = 0
    good: int = 0
    lost: int = 0
    false: int = 0
    seconds: float = 0.0
    faults: list[str] = field(default_factory=list)

    def add(self, other: Outcome) -> None:
        """Takes in another round on the same device."""
        self.amount += other.amount
        self.good += other.good
        self.lost += other.lost
        self.false += other.false
        self.seconds += other.seconds
        self.faults += other.faults


def allowed(amount: int, probability: float) -> int:
    """False accepts that so many trials may show: the Poisson bound."""
    return int(poisson.ppf(CONFIDENCE, amount * probability))
