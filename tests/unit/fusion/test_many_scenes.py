"""A share of the contacts of `make bench`: every answer is certified and tight, some are checked to 25 digits."""

from __future__ import annotations

import numpy as np
import pytest
from bench.million import MEDIAN_GAP, WORST_GAP, Answers, Findings, measure
from chart.scenes import FAMILIES

pytestmark = pytest.mark.statistics

SCENES = 4_500
EVERY = 151
"""One round of the families in so many is checked; odd, so that the checked ones are of both senses."""

CHECKED_OF_EACH_FAMILY = 2


@pytest.fixture(scope="module")
def found() -> Findings:
    return measure(range(SCENES), every=EVERY)


def seeds(answers: Answers, mask: np.ndarray) -> list[int]:
    return answers.seeds[mask].tolist()


@pytest.mark.parametrize("question", ["limit", "use"])
def test_every_answer_is_certified_its_bounds_meet_and_the_reference_lies_within(
    found: Findings, question: str
) -> None:
    answers: Answers = getattr(found, question)
    assert found.reasons == {}
    assert answers.sound.all()
    due = ~answers.verge & ~answers.free
    assert due.mean() > 0.98
    assert seeds(answers, due & ~(answers.gap <= WORST_GAP)) == []
    assert np.median(answers.gap[due]) <= MEDIAN_GAP
    assert np.bincount(answers.seeds[answers.checked] % len(FAMILIES)).min() >= CHECKED_OF_EACH_FAMILY - 1
    assert seeds(answers, answers.checked & ~answers.inside) == []
    assert answers.error.max() <= WORST_GAP
