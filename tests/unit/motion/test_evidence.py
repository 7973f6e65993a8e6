"""Evidence of motion, and the rule that combines it, keep to their risk; NaN is no evidence."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from slipd.motion.evidence import (
    EVIDENCE,
    TOGETHER_NS,
    Evidence,
    MotionRisk,
    combined_surprise,
    evidence_mask,
    evidence_names,
    f_surprise,
)

LOOK_NS = 100_000_000
HOUR_LOOKS = 36_000.0


def test_a_mask_names_its_kinds_in_their_fixed_order() -> None:
    assert EVIDENCE == ("load_drop", "image_change", "width", "external")
    for count in range(len(EVIDENCE) + 1):
        for kinds in itertools.combinations(EVIDENCE, count):
            assert evidence_names(evidence_mask(*reversed(kinds), *kinds)) == kinds


def test_a_surprise_is_bounded_and_nothing_unknown_is_one() -> None:
    gamma = 6.0 - math.log(1.0 + 6.0 + 18.0)
    assert (combined_surprise([5.0]), combined_surprise([1.0, 2.0, 3.0])) == (5.0, pytest.approx(gamma))
    numbers = (0.0, 3, 30), (9.0, 1, 1e6), (1e12, 3, 1e4), (math.inf, 1, 10)
    assert [f_surprise(*each) for each in numbers] == pytest.approx([0.0, -math.log(0.0027), 700.0, 700.0], rel=1e-3)
    for numbers in itertools.product((1.0, math.nan), repeat=3):
        assert f_surprise(*numbers) < 2.0
    risk = MotionRisk(1.0, {"image_change": HOUR_LOOKS, "width": HOUR_LOOKS})
    assert risk.update(Evidence("image_change", 0, math.nan)) == risk.update(Evidence("width", 0, 9.0)) == ()
    assert risk.update(Evidence("image_change", 0, 9.0), belief=math.nan) == ()


@pytest.mark.uncovered
@pytest.mark.parametrize("kinds", [("width",), ("image_change", "width"), ("image_change", "width", "external")])
def test_noise_is_reported_as_often_as_the_risk_allows(kinds: tuple[str, ...]) -> None:
    """Half an hour of looks of exponential surprises, at 240 false alarms an hour; those of combined kinds overlap."""
    risk = MotionRisk(240.0, dict.fromkeys(kinds, HOUR_LOOKS))
    surprises = np.random.default_rng(4).exponential(size=(int(0.5 * HOUR_LOOKS), len(kinds)))
    found = 0
    for k, looks in enumerate(surprises.tolist()):
        found += any(list(map(risk.update, map(Evidence, kinds, [k * LOOK_NS] * len(kinds), looks))))
    assert 48 < found < 120 + 5.0 * math.sqrt(120.0)


def test_weak_evidence_of_two_kinds_counts_together_only_at_one_time() -> None:
    risk = MotionRisk(1.0, {"width": HOUR_LOOKS, "image_change": HOUR_LOOKS})
    assert risk.update(Evidence("image_change", 0, 9.0)) == ()
    assert risk.update(Evidence("width", TOGETHER_NS + 1, 9.0)) == ()
    assert risk.update(Evidence("image_change", 2 * TOGETHER_NS + 1, 9.0)) == ("image_change", "width")


@pytest.mark.parametrize(
    ("per_hour", "belief", "found"), [(1.0, {}, True), (0.5, {}, False), (0.5, {"belief": 0.7}, True)]
)
def test_a_smaller_risk_asks_for_more_and_a_belief_for_less(per_hour: float, belief: Any, found: bool) -> None:
    look = Evidence("width", 0, math.log(HOUR_LOOKS) + 0.1)
    assert MotionRisk(per_hour, {"width": HOUR_LOOKS}).update(look, **belief) == ("width",) * found
