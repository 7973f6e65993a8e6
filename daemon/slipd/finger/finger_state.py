"""What is known of one finger after one force reading."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from slipd.finger.load_distribution import LoadDistribution
from slipd.finger.verdict import STREAM_STALE, Verdict
from slipd.friction.friction_state import FrictionState
from slipd.fusion import Contact, Utilisation
from slipd.fusion.levels import Assessment
from slipd.motion.evidence import evidence_names


class ForceReading(NamedTuple):
    """One reading of the force, as far as it is known without an image.

    Attributes:
        wrench: Force on the finger, N, and torque about the pad's origin, N·m, both in the pad frame: six numbers, NaN
            where unknown. None where nothing is known.
        status: Conditions that the device reported with the reading.
        age_s: Age of the reading when it was received, s; None before the first.
    """

    wrench: tuple[float, ...] | None
    status: tuple[str, ...]
    age_s: float | None


@dataclass(slots=True)
class FingerState:
    """State of a finger after one force reading: the verdict and the quantities behind it. None or NaN is unknown.

    Attributes:
        t_ns: When the reading was acquired, CLOCK_MONOTONIC.
        verdict: Level and reasons.
        wrench: Force on the finger, N, and torque about the pad's origin, N·m, both in the pad frame: six numbers.
        contact: Contact by the force sensor alone, in the pad frame; not valid without contact.
        load_distribution: Shares of the normal force on the taxels, by the image.
        utilisation: λ of the load, with its bounds; only its pole is known without a coefficient of friction.
        tipping_margin_m: Signed distance of the contact centroid to the outline of the image, m; negative outside.
        assessment: Result of the slip decision; None without a contact.
        model: Most that the utilisation takes into account: "none", "translation" or "exact".
        status: Conditions that the device reported with the reading.
        age_s: Age of the reading when it was received, s; None before the first.
        friction: What was known of the friction; None where nothing touches or the reading says nothing.
    """

    t_ns: int
    verdict: Verdict
    wrench: tuple[float, ...] | None = None
    contact: Contact | None = None
    load_distribution: LoadDistribution | None = None
    utilisation: Utilisation | None = None
    tipping_margin_m: float = math.nan
    assessment: Assessment | None = None
    model: str = "none"
    status: tuple[str, ...] = ()
    age_s: float | None = None
    friction: FrictionState | None = None

    @property
    def level(self) -> str:
        """Name of the level."""
        return self.verdict.level

    @property
    def is_stale(self) -> bool:
        """Nothing is known: the reading is too old, or the stream ended."""
        return self.verdict is STREAM_STALE

    @property
    def normal_n(self) -> float | None:
        """Normal force by the force sensor, N; None where it is not known, or clearly negative."""
        return None if self.contact is None else self.contact.normal_n

    @property
    def evidence(self) -> tuple[str, ...]:
        """What shows that the object moves, words of `slipd.motion.evidence.EVIDENCE`; empty where nothing does."""
        return () if self.assessment is None else evidence_names(self.assessment.evidence)

    @property
    def required_friction(self) -> float:
        """q, the coefficient of friction at which the load would just slip; NaN where unknown."""
        return math.nan if self.assessment is None else self.assessment.required_friction

    @property
    def force_reading(self) -> ForceReading:
        """The force alone."""
        return ForceReading(self.wrench, self.status, self.age_s)
