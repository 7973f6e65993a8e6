"""The rule that combines evidence of motion keeps to its risk."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.motion.evidence import Evidence
from slipd.motion.risk import TOGETHER_NS, MotionRisk, combined_surprise

LOOK_NS = 100_000_000
HOUR_LOOKS = 36_000.0


def alarms(risk: MotionRisk, surprises: dict[str, np.ndarray]) -> int:
    """Count the looks at which evidence of these kinds, all at the same times, shows motion."""
    found = 0
    for k in range(len(next(iter(surprises.values())))):
        shown = [risk.update(Evidence(kind, k * LOOK_NS, float(of[k]))) for kind, of in surprises.items()]
        found += any(shown)
    return found


@pytest.mark.no_cover
@pytest.mark.parametrize(
    "kinds", [("vibration",), ("image_change", "vibration"), ("image_change", "width", "external")]
)
def test_noise_is_reported_as_often_as_the_risk_allows(kinds: tuple[str, ...]) -> None:
    # 5 hours of looks of exponential surprises, at 60 false alarms an hour: 300 expected, a share of it where kinds
    # are combined (their alarms overlap). Poisson: 300 + 5 sqrt(300) < 387.
    rng = np.random.default_rng(4)
    risk = MotionRisk(60.0, dict.fromkeys(kinds, HOUR_LOOKS))
    found = alarms(risk, {kind: rng.exponential(size=int(5 * HOUR_LOOKS)) for kind in kinds})
    assert 120 < found < 387


def test_weak_evidence_of_two_kinds_counts_together_only_at_one_time() -> None:
    risk = MotionRisk(1.0, {"image_change": HOUR_LOOKS, "vibration": HOUR_LOOKS})
    assert risk.update(Evidence("image_change", 0, 9.0)) == ()
    assert risk.update(Evidence("vibration", TOGETHER_NS + 1, 9.0)) == ()
    assert risk.update(Evidence("image_change", TOGETHER_NS + 2, 9.0)) == ("image_change", "vibration")


def test_a_smaller_risk_asks_for_more_and_a_belief_for_less() -> None:
    surprise = math.log(HOUR_LOOKS / 1.0) + 0.1
    look = Evidence("width", 0, surprise)
    assert MotionRisk(1.0, {"width": HOUR_LOOKS}).update(look) == ("width",)
    assert MotionRisk(0.5, {"width": HOUR_LOOKS}).update(look) == ()
    assert MotionRisk(0.5, {"width": HOUR_LOOKS}).update(look, belief=0.7) == ("width",)


def test_the_combined_surprise_is_that_of_a_gamma_variable() -> None:
    assert combined_surprise([5.0]) == 5.0
    assert combined_surprise([3.0, 4.0]) == pytest.approx(7.0 - math.log(1.0 + 7.0))
    assert combined_surprise([1.0, 2.0, 3.0]) == pytest.approx(6.0 - math.log(1.0 + 6.0 + 18.0))


@pytest.mark.parametrize(
    ("per_hour", "looks", "text"),
    [
        (1.0, {"smell": 10.0}, "kinds of evidence must be among"),
        (1.0, {"width": 0.0}, "must be positive"),
        (0.0, {"width": 10.0}, "must be positive"),
        (1.0, {}, "must be positive"),
    ],
)
def test_wrong_settings_are_refused(per_hour: float, looks: dict[str, float], text: str) -> None:
    with pytest.raises(ValueError, match=text):
        MotionRisk(per_hour, looks)
