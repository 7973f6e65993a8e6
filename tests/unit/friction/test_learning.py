"""Friction learned in one contact, from rows of readings."""

from __future__ import annotations

import math

import pytest
from learning_hand import STEP_S, Hand, Q, carry, slip

from slipd.fusion.rows import UNTRUSTED

pytestmark = pytest.mark.usefixtures("both_ways")


def test_the_stated_coefficient_is_used_as_it_stands_with_the_interval_of_its_spread(hand: Hand) -> None:
    state = hand.estimate.state
    assert (state.mu, state.source, state.mu_d, state.carried) == (0.5, "config", None, None)
    assert (state.mu_low, state.mu_high) == (
        pytest.approx(0.5 * math.exp(-0.1645)),
        pytest.approx(0.5 * math.exp(0.1645)),
    )


def test_a_load_that_lasts_becomes_the_lower_bound_where_it_is_larger(hand: Hand) -> None:
    state = hand.feel(carry(0.4))
    assert (state.mu, state.source, state.carried) == (0.5, "config", pytest.approx(0.4))
    state = hand.feel(carry(0.6))
    assert (state.mu, state.source, state.carried) == (pytest.approx(0.6), "learned", pytest.approx(0.6))
    assert state.mu_low == pytest.approx(0.6)
    assert state.mu_high == pytest.approx(0.6 * math.exp(0.1645))
    assert hand.feel(carry(0.3)).mu == pytest.approx(0.6), "it was carried"


def test_a_load_shorter_than_the_dwell_raises_nothing(hand: Hand) -> None:
    assert hand.feel([*carry(0.2), *carry(0.6, 0.05), *carry(0.2)]).carried == pytest.approx(0.2)


def test_a_gap_in_the_readings_is_not_carried(hand: Hand) -> None:
    hand.feel(carry(0.6, 0.06))
    hand._t_s += 1.0
    assert hand.feel(carry(0.6, 0.06)).carried is None


def test_readings_that_come_ten_times_a_second_are_enough(hand: Hand) -> None:
    for _ in range(5):
        state = hand.feel(carry(0.6, STEP_S))
        hand._t_s += 0.1 - STEP_S
    assert state.carried == pytest.approx(0.6)


def test_noise_few_readings_and_few_taxels_lower_the_bound(hand: Hand) -> None:
    exact = hand.feel(carry(0.6)).mu
    noisy = Hand().feel(carry(0.6), noise=0.06).mu
    spinning = Hand().feel(carry(0.6), ratio=0.2, shape=0.1).mu
    assert spinning < noisy < exact
    assert spinning == pytest.approx(0.6 * math.exp(-1.645 * 0.08))


def test_a_slip_lowers_a_coefficient_that_is_a_fifth_too_high_at_once(hand: Hand) -> None:
    """Nothing of the prior survives: the bound is below the peak by the scatter of one slip and of the next."""
    state = hand.feel([*carry(0.35), *slip(0.5 / 1.2, 0.35)])
    bound = 0.5 / 1.2 * math.exp(-1.645 * math.sqrt(2) * 0.05)
    assert (state.mu, state.source) == (pytest.approx(bound), "learned")
    assert state.mu_high == pytest.approx(0.5 / 1.2 * math.exp(1.645 * math.sqrt(2) * 0.05))
    assert state.mu_d == pytest.approx(0.35)


def test_a_slip_inside_the_interval_of_the_prior_is_combined_with_it(hand: Hand) -> None:
    state = hand.feel(slip(0.47, 0.4))
    alone = Hand(None).feel(slip(0.47, 0.4))
    assert alone.mu < state.mu < 0.47


def test_slips_that_agree_narrow_the_interval_and_slips_that_do_not_widen_it() -> None:
    def width(*peaks: float) -> float:
        hand = Hand(None)
        for peak in peaks:
            state = hand.feel([*carry(0.3), *slip(peak, 0.3)])
        return state.mu_high / state.mu_low

    assert width(0.5, 0.5, 0.5) < width(0.5) < width(0.5, 0.35)


def test_newer_slips_weigh_more() -> None:
    def middle(*peaks: float) -> float:
        hand = Hand(None)
        for peak in peaks:
            state = hand.feel([*carry(0.2), *slip(peak, 0.2)])
        return math.sqrt(state.mu_low * state.mu_high)

    assert middle(0.5, 0.45) < math.sqrt(0.5 * 0.45) < middle(0.45, 0.5)
    assert middle(*[0.5] * 9, 0.4, 0.4, 0.4, 0.4) == pytest.approx(0.4), "older ones are forgotten"


def test_more_carried_than_a_false_slip_shows_overrides_it(hand: Hand) -> None:
    lowered = hand.feel([*carry(0.2), *slip(0.25, 0.2)]).mu
    assert lowered < 0.25
    assert hand.feel(carry(0.26)).mu == pytest.approx(0.26), "the lower bound counts at once"
    state = hand.feel(carry(0.3))
    assert (state.mu, state.source) == (0.5, "config"), "no slip can have been there"


def test_what_was_carried_overrides_only_the_slips_that_it_disproves() -> None:
    hand, other = Hand(None), Hand(None)
    hand.feel([*carry(0.2), *slip(0.25, 0.2)])
    for each in (hand, other):
        each.feel([*carry(0.3), *slip(0.5, 0.4)])
        each.feel(carry(0.45))
    found, expected = hand.estimate.state, other.estimate.state
    assert (found.mu, found.mu_low, found.mu_high) == (expected.mu, expected.mu_low, expected.mu_high)
    assert found.source == "learned"


def test_a_slip_forgets_what_was_carried_before_it_for_the_bound_but_not_for_the_trend(hand: Hand) -> None:
    state = hand.feel([*carry(0.6), *slip(0.6, 0.4)])
    assert state.carried == pytest.approx(0.6)
    assert state.mu < 0.57


def test_one_slip_gives_one_sample_however_long_it_lasts() -> None:
    once, hand = Hand(None).feel(slip(0.5, 0.4)), Hand(None)
    hand.feel(slip(0.5, 0.4))
    chattering = hand.feel(slip(0.42, 0.4))
    assert (chattering.mu_low, chattering.mu_high) == (once.mu_low, once.mu_high)


def test_motion_without_a_drop_gives_a_rough_sample_that_a_later_peak_replaces() -> None:
    hand = Hand(None)
    creeps = [*carry(0.45), *[(0.45, math.nan, math.nan, True)] * 5]
    rough = hand.feel(creeps)
    assert (rough.mu, rough.source) == (pytest.approx(0.45 * math.exp(-1.645 * math.sqrt(0.015))), "learned")
    assert rough.mu_d is None
    assert hand.feel(slip(0.5, 0.4)) == Hand(None).feel([*carry(0.45), *slip(0.5, 0.4)])


def test_without_a_prior_the_coefficient_is_unknown_until_a_slip_shows_it() -> None:
    hand = Hand(None)
    state = hand.feel(carry(0.6))
    assert (state.mu, state.source, state.mu_low, state.mu_high) == (None, "none", pytest.approx(0.6), None)
    assert state.carried == pytest.approx(0.6)
    assert hand.feel(slip(0.7, 0.6)).source == "learned"


def test_a_coefficient_known_exactly_is_not_learned() -> None:
    hand = Hand(0.5, spread=0.0)
    state = hand.feel([*carry(0.6), *slip(0.4, 0.3)])
    assert (state.mu, state.source, state.mu_low, state.mu_high) == (0.5, "config", 0.5, 0.5)
    assert state.mu_d == pytest.approx(0.3)


def test_nothing_raises_the_coefficient_beyond_the_largest_that_is_allowed() -> None:
    hand = Hand(most=0.7)
    assert hand.feel(carry(0.9)).mu == 0.7
    assert hand.feel(slip(0.9, 0.8)).mu == 0.7
    assert Hand(None, most=0.3).feel(slip(0.9, 0.8)).mu == 0.3


@pytest.mark.parametrize("untrusted", [{"phase": UNTRUSTED}, {"teaches": False}])
def test_readings_that_are_not_trusted_teach_nothing(hand: Hand, untrusted: dict[str, int]) -> None:
    before = hand.feel(carry(0.4))
    assert hand.feel([*carry(0.8), *slip(0.3, 0.2)], **untrusted) == before  # type: ignore[arg-type]


def test_readings_without_a_known_zero_show_slips_but_raise_nothing(hand: Hand) -> None:
    state = hand.feel(carry(0.6), raises=False)
    assert (state.mu, state.source, state.carried) == (0.5, "config", pytest.approx(0.6))
    state = hand.feel(slip(0.4, 0.3), raises=False)
    assert state.source == "learned"


def test_a_reading_that_is_not_trusted_interrupts_the_dwell(hand: Hand) -> None:
    hand.feel(carry(0.6, 0.09))
    hand.feel(carry(0.6, STEP_S), phase=UNTRUSTED)
    assert hand.feel(carry(0.6, 0.09)).carried is None


def test_the_end_of_the_contact_starts_anew(hand: Hand) -> None:
    fresh = hand.estimate.state
    hand.feel([*carry(0.6), *slip(0.4, 0.3)])
    assert hand.let_go() == fresh
    hand.feel([*carry(0.6), *slip(0.4, 0.3)])
    hand.estimate.end_contact()
    assert hand.estimate.state == fresh


def test_other_coefficients_forget_everything(hand: Hand) -> None:
    hand.estimate.set_object("mug")
    hand.feel(slip(0.4, 0.3))
    hand.let_go()
    hand.estimate.set(0.7, 0.6, "ann", None)
    state = hand.estimate.state
    assert (state.mu, state.source, state.mu_d, state.object_name) == (0.7, "request", 0.6, "mug")


@pytest.mark.parametrize("lets_go", [False, True])
def test_another_zero_forgets_what_is_more_lenient_and_keeps_what_is_stricter(hand: Hand, *, lets_go: bool) -> None:
    for name, q in (("tyre", 0.9), ("soap", 0.2)):
        hand.estimate.set_object(name)
        hand.feel(slip(q, 0.8 * q))
        if lets_go:
            hand.let_go()
    strict = hand.estimate.state
    assert strict.mu < 0.3
    hand.estimate.doubt()
    assert hand.estimate.state.mu == pytest.approx(strict.mu, rel=0.1)
    assert (hand.estimate.least_known < 0.3) is lets_go
    hand.estimate.set_object("tyre")
    assert (hand.estimate.state.mu, hand.estimate.state.source) == (0.5, "config"), "a zero that is wrong by more"


def test_what_was_learned_counts_from_the_next_step_of_time(hand: Hand) -> None:
    times_ns = [1_000_000_000 + k * 7_000_000 for k in range(8)]
    assert [hand.estimate.begin_step(times_ns, begin) for begin in (0, 3, 6)] == [3, 6, 8]
    assert hand.estimate.begin_step([1_050_000_000, 1_059_000_000], 0) == 2


@pytest.mark.parametrize("seen", [slip(0.9, 0.8), [(0.9, math.nan, math.nan, True)] * 5], ids=["fall", "creep"])
def test_a_slip_without_a_known_zero_raises_nothing_either(hand: Hand, seen: list[Q]) -> None:
    state = hand.feel([*carry(0.9), *seen], raises=False)
    assert state.mu <= 0.5
    assert Hand(None).feel([*carry(0.9), *seen], raises=False).source == "none", "unknown does not become safe"


def test_motion_seen_during_a_shock_raises_no_friction_beyond_what_lasted(hand: Hand) -> None:
    shock = [(1.4, math.nan, math.nan, True), *[(0.2, math.nan, math.nan, True)] * 5]
    state = hand.feel([*carry(0.2), *shock])
    assert state.mu <= 0.5
    unstated = Hand(None).feel([*carry(0.2), *shock])
    assert unstated.mu <= 0.2
    assert Hand(None).feel(shock).mu is None, "nothing lasted"


def test_a_long_time_without_trusted_readings_ends_what_was_learned(hand: Hand) -> None:
    """Another object may be in the grip by then."""
    fresh = hand.estimate.state
    assert hand.feel(carry(0.8)).mu == pytest.approx(0.8)
    hand.feel(carry(0.8, 0.2), phase=UNTRUSTED)
    assert hand.feel(carry(0.1)).mu == pytest.approx(0.8)
    hand.feel(carry(0.8, 0.4), phase=UNTRUSTED)
    assert hand.feel(carry(0.1, 0.02)) == fresh


def test_dynamic_friction_is_never_above_the_interval_of_static_friction(hand: Hand) -> None:
    hand.estimate.set(0.6, 0.55, "ann", None)
    state = hand.feel([*carry(0.2), (0.25, 0.3, math.nan, True)])
    assert state.mu_d <= state.mu_high < 0.4
