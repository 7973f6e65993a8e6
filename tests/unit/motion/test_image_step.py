"""Evidence of motion from images that change at unchanged grip."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.motion.image_step import BACKGROUND, LONGEST_LOOK_NS, LOOK_NS, LOOKS_PER_HOUR, ImageStep
from slipd.types.arrays import Array

PERIOD_NS = 100_000_000
ALARM = math.log(LOOKS_PER_HOUR)
"""Surprise that noise reaches once an hour."""


def pad(shift: float = 0.0, total: float = 20_000.0) -> Array:
    """Return the pressure on 4 × 4 taxels under a box whose edge is ``shift`` pitches further along x."""
    x = np.arange(4.0)
    along = np.clip(3.0 + shift - x, 0.0, 1.0)
    pressure = np.tile(along, (4, 1)).ravel()
    return np.asarray(pressure / pressure.sum() * total)


@pytest.mark.no_cover
def test_a_hold_with_the_background_of_real_holds_alarms_about_once_an_hour() -> None:
    rng = np.random.default_rng(7)
    step, alarms, hours = ImageStep(), 0, 4
    direction = np.zeros(16)
    direction[0], direction[1] = math.sqrt(0.5), -math.sqrt(0.5)
    shares, sense = np.full(16, 1 / 16), 1.0
    for k in range(int(hours * LOOKS_PER_HOUR)):
        shares = shares + sense * BACKGROUND * rng.exponential() * direction
        sense = -math.copysign(1.0, float((shares - 1 / 16) @ direction))
        surprise = step.update([20_000.0 * np.clip(shares, 0.0, None)] * 2, k * PERIOD_NS)
        alarms += surprise is not None and surprise > ALARM
    assert alarms <= 13  # Poisson: 4 expected, 13 or fewer with 99.99 %


def test_a_box_that_slides_by_a_fifth_of_the_pitch_is_seen() -> None:
    step = ImageStep()
    for k in range(5):
        step.update([pad(), pad(0.001 * k)], k * PERIOD_NS)
    surprise = step.update([pad(0.2), pad(0.2)], 5 * PERIOD_NS)
    assert surprise is not None
    assert surprise > 5.0


def test_a_motion_that_goes_on_counts_twice_as_much_as_one_that_swings_back() -> None:
    surprises = []
    for places in ((0.0, 0.1, 0.2), (0.0, 0.1, 0.0)):
        step = ImageStep()
        surprises.append([step.update([pad(place)], k * PERIOD_NS) for k, place in enumerate(places)][-1])
    assert surprises[0] == pytest.approx(2.0 * surprises[1], rel=0.05)


def test_shares_that_change_with_the_grip_are_no_look() -> None:
    step = ImageStep()
    assert step.update([pad()], 0) is None
    assert step.update([pad(0.5, 30_000.0)], PERIOD_NS) is None
    before = step.update([pad(0.51, 30_100.0)], 2 * PERIOD_NS)
    assert before is not None
    creeping = step.update([pad(0.52, 32_000.0)], 3 * PERIOD_NS)
    assert creeping is not None
    since_last = step.update([pad(0.9, 34_500.0)], 4 * PERIOD_NS)
    assert since_last is not None, "the grip of the last look is the same, that of the one before is not"


def test_a_repeated_image_or_an_early_or_late_one_is_no_look() -> None:
    step = ImageStep()
    assert step.update([pad()], 0) is None
    assert step.update([pad(0.1)], LOOK_NS - 1) is None
    assert step.update([pad()], LOOK_NS) is None
    assert step.update([pad(0.1)], LOOK_NS + 1) is not None
    assert step.update([pad(0.2)], LOOK_NS + 2 + LONGEST_LOOK_NS) is None


def test_both_pads_count_alike() -> None:
    both, one = ImageStep(), ImageStep()
    both.update([pad(), pad()], 0)
    one.update([pad(), pad()], 0)
    of_both = both.update([pad(0.2), pad(0.2)], PERIOD_NS)
    of_one = one.update([pad(0.2), pad(0.0001)], PERIOD_NS)
    assert of_both is not None
    assert of_one is not None
    np.testing.assert_allclose(of_one, 0.5 * of_both, rtol=0.01)


def test_a_grasp_with_more_background_of_its_own_asks_for_more() -> None:
    calm, restless = ImageStep(), ImageStep()
    for k in range(300):
        calm.update([pad(0.001 * (k % 2))], k * PERIOD_NS)
        restless.update([pad(0.3 * (k % 2))], k * PERIOD_NS)
    of_calm, of_restless = calm.update([pad(0.9)], 300 * PERIOD_NS), restless.update([pad(0.9)], 300 * PERIOD_NS)
    assert of_calm is not None
    assert of_restless is not None
    assert of_restless < 0.5 * of_calm


def test_a_new_grasp_has_nothing_to_compare_with() -> None:
    step = ImageStep()
    assert step.update([pad()], 0) is None
    assert step.update([pad(0.2)], LOOK_NS) is not None
    step.forget()
    assert step.update([pad(0.4)], 2 * LOOK_NS) is None
