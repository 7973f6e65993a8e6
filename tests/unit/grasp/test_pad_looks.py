"""Images of pads that measure the force change at unchanged grip, under a load that makes a motion likely."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.grasp.pad_motion import (
    AHEAD,
    BACKGROUND,
    BELIEF_AT_LIMIT,
    LOOK_NS,
    LOOKS_PER_HOUR,
    ImageStep,
    LoadBelief,
    belong_together,
)
from slipd.motion.evidence import REPORTED_NS
from slipd.types.arrays import Array

PERIOD_NS = 100_000_000
ALARM = math.log(LOOKS_PER_HOUR)
"""Surprise that noise reaches once an hour."""


def pad(shift: float = 0.0, total: float = 20_000.0) -> Array:
    """Return the pressure on 4 × 4 taxels under a box whose edge is ``shift`` pitches further along x."""
    pressure = np.tile(np.clip(3.0 + shift - np.arange(4.0), 0.0, 1.0), 4)
    return np.asarray(pressure / pressure.sum() * total)


def surprises(*places: tuple[float, ...], step: ImageStep | None = None) -> list[float]:
    """Return the surprise of each look at pads with these edges; NaN where it is none."""
    step = step or ImageStep()
    found = [step.update([pad(shift) for shift in at], k * PERIOD_NS) for k, at in enumerate(places)]
    return [math.nan if surprise is None else surprise for surprise in found]


@pytest.mark.statistics
def test_a_hold_with_the_background_of_real_holds_alarms_about_once_an_hour() -> None:
    rng = np.random.default_rng(7)
    step, alarms, hours = ImageStep(), 0, 1
    direction = np.array([math.sqrt(0.5), -math.sqrt(0.5)] + [0.0] * 14)
    shares, sense = np.full(16, 1 / 16), 1.0
    for k in range(int(hours * LOOKS_PER_HOUR)):
        shares = shares + sense * BACKGROUND * rng.exponential() * direction
        sense = -math.copysign(1.0, float((shares - 1 / 16) @ direction))
        surprise = step.update([20_000.0 * np.clip(shares, 0.0, None)] * 2, k * PERIOD_NS)
        alarms += surprise is not None and surprise > ALARM
    assert alarms <= 6  # Poisson: 1 expected, 6 or fewer with 99.99 %


def test_a_slide_by_a_fifth_of_the_pitch_is_seen_on_both_pads_and_half_of_it_on_one() -> None:
    still = [(0.0, 0.001 * k) for k in range(5)]
    both, one = (surprises(*still, places)[-1] for places in ((0.2, 0.204), (0.2, 0.0041)))
    assert both > 5.0
    assert one == pytest.approx(0.5 * both, rel=0.01)


def test_a_motion_that_goes_on_counts_twice_as_much_as_one_that_swings_back() -> None:
    on, back = (surprises((0.0,), (0.1,), (last,))[-1] for last in (0.2, 0.0))
    assert on == pytest.approx(2.0 * back, rel=0.05)


def test_shares_that_change_with_the_grip_are_no_look() -> None:
    step = ImageStep()
    images = [pad(), pad(0.5, 30_000.0), pad(0.51, 30_100.0), pad(0.52, 32_000.0), pad(0.9, 34_500.0)]
    looks = [step.update([image], k * PERIOD_NS) is not None for k, image in enumerate(images)]
    assert looks == [False, False, True, True, True], "the grip of the last look is the same in the end"


def test_a_repeated_image_or_an_early_or_late_one_is_no_look_and_a_new_grasp_begins_anew() -> None:
    step, late_ns = ImageStep(), LOOK_NS + 2 + REPORTED_NS
    looks = [(0.0, 0), (0.1, LOOK_NS - 1), (0.0, LOOK_NS), (0.1, LOOK_NS + 1), (0.2, late_ns), (0.3, late_ns + LOOK_NS)]
    seen = [step.update([pad(shift)], t_ns) is not None for shift, t_ns in looks]
    assert seen == [False, False, False, True, False, True]
    step.forget()
    assert step.update([pad(0.4)], late_ns + 2 * LOOK_NS) is None


def test_a_grasp_with_more_background_of_its_own_asks_for_more() -> None:
    calm, restless = (surprises(*[(by * (k % 2),) for k in range(300)], (0.9,))[-1] for by in (0.001, 0.3))
    assert restless < 0.5 * calm


def test_the_belief_grows_with_the_larger_utilisation_and_looks_ahead() -> None:
    for spin, tangential, largest in ((0.2, 0.5, 0.5), (-0.8, 0.5, 0.8)):
        assert LoadBelief().update(spin, tangential) == pytest.approx(largest * BELIEF_AT_LIMIT)
    belief = LoadBelief()
    belief.update(-0.2, 0.0)
    assert belief.update(-0.6, 0.0) == pytest.approx((0.6 + AHEAD * 0.4) * BELIEF_AT_LIMIT)


def test_what_was_carried_two_looks_ago_adds_no_belief_until_the_object_moved() -> None:
    belief = LoadBelief()
    assert min(belief.update(0.7, 0.7) for _ in range(3)) > 0.0
    assert belief.update(0.5, 0.5) == 0.0
    assert belief.update(0.9, 0.9) > BELIEF_AT_LIMIT * 0.9
    belief.forget_carried()
    assert belief.update(0.9, 0.9) == pytest.approx(BELIEF_AT_LIMIT * 0.9)
    belief.forget()
    assert belief.update(0.7, 0.7) == pytest.approx(0.7 * BELIEF_AT_LIMIT)
    assert belief.update(0.5, 0.5) > 0.0, "the last look may have been a motion"
    assert belief.update(0.5, 0.5) == 0.0


@pytest.mark.parametrize(
    ("times_ns", "rate_hz", "together"),
    [
        ((0,), 0.0, True), ((7, 7), 0.0, True), ((0, 5_000_000), 100.0, True),
        ((0, 9_000_000), 100.0, False),  # the next image of the other pad is nearer
    ],
)  # fmt: skip
def test_images_of_pads_with_clocks_of_their_own_belong_together(
    times_ns: tuple[int, ...], rate_hz: float, together: bool
) -> None:
    assert belong_together(times_ns, 1e9 / rate_hz if rate_hz else 0.0) is together
