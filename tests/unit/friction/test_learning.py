"""Friction learned from rows of readings, as the kernels of the contact fill them in."""

from __future__ import annotations

import math
from collections.abc import Iterable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slipd.friction.friction_estimate import FrictionEstimate
from slipd.friction.friction_state import FrictionState
from slipd.fusion.rows import FREE, READING, TOUCHING, UNTRUSTED, Rows, new_rows

STEP_S = 0.005
"""Time from one reading to the next, s."""
Q = tuple[float, float, float, bool]
"""Required friction, peak, plateau, and whether it slips."""


def carry(q: float, seconds: float = 0.3) -> list[Q]:
    """Readings that carry q without motion."""
    return [(q, math.nan, math.nan, False)] * round(seconds / STEP_S)


def slip(peak: float, plateau: float, seconds: float = 0.05) -> list[Q]:
    """Readings of a slip from a peak to a plateau, of which the first also shows the peak."""
    return [(plateau, peak, plateau, True), *[(plateau, math.nan, plateau, True)] * round(seconds / STEP_S)]


class Hand:
    """An estimate, and the readings that it gets."""

    def __init__(self, mu: float | None = 0.5, spread: float = 0.1, most: float = 1.0) -> None:
        self.estimate = FrictionEstimate(mu, spread, most)
        self._t_s = 100.0

    def feel(
        self,
        readings: Iterable[Q],
        *,
        phase: int = TOUCHING,
        ratio: float = 1.0,
        noise: float = 0.0,
        shape: float = 0.0,
        teaches: bool = True,
        raises: bool = True,
        pauses: bool = True,
    ) -> FrictionState:
        """Learn from readings of a pure translation; ``ratio``: the part of q that the friction ratio is."""
        values = list(readings)
        rows = new_rows(READING, len(values))
        times_ns = [round((self._t_s + (k + 1) * STEP_S) * 1e9) for k in range(len(values))]
        self._t_s += len(values) * STEP_S
        self._fill(rows, values, times_ns)
        rows["phase"], rows["contact"]["friction_ratio_std"] = phase, noise
        rows["contact"]["friction_ratio"] = ratio * rows["assessment"]["required_friction"]
        for begin, end in self.estimate.segments(times_ns):
            self.estimate.learn(rows[begin:end], shape, teaches=teaches, raises=raises)
        if pauses:
            self.pause()
        return self.estimate.state

    def pause(self) -> None:
        """Let a step of time pass, so that what was learned is in force."""
        list(self.estimate.segments([round((self._t_s + 0.02) * 1e9)]))

    @staticmethod
    def _fill(rows: Rows, values: list[Q], times_ns: list[int]) -> None:
        rows["t_s"] = [t_ns * 1e-9 for t_ns in times_ns]
        names = ("required_friction", "peak_required", "plateau_required", "slips")
        for name, column in zip(names, zip(*values, strict=True), strict=True):
            rows["assessment"][name] = column

    def let_go(self) -> FrictionState:
        """End the contact."""
        return self.feel(carry(math.nan, STEP_S), phase=FREE)


@pytest.fixture
def hand() -> Hand:
    """μ 0.5 by the config with a spread of a tenth, at most 1."""
    return Hand()


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
    assert exact is not None
    assert noisy is not None
    assert spinning is not None
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
    assert alone.mu is not None
    assert state.mu is not None
    assert alone.mu < state.mu < 0.47


def test_slips_that_agree_narrow_the_interval_and_slips_that_do_not_widen_it() -> None:
    def width(*peaks: float) -> float:
        hand = Hand(None)
        for peak in peaks:
            state = hand.feel([*carry(0.3), *slip(peak, 0.3)])
        assert state.mu_low is not None
        assert state.mu_high is not None
        return state.mu_high / state.mu_low

    assert width(0.5, 0.5, 0.5) < width(0.5) < width(0.5, 0.35)


def test_newer_slips_weigh_more() -> None:
    def middle(*peaks: float) -> float:
        hand = Hand(None)
        for peak in peaks:
            state = hand.feel([*carry(0.2), *slip(peak, 0.2)])
        assert state.mu_low is not None
        assert state.mu_high is not None
        return math.sqrt(state.mu_low * state.mu_high)

    assert middle(0.5, 0.45) < math.sqrt(0.5 * 0.45) < middle(0.45, 0.5)
    assert middle(*[0.5] * 9, 0.4, 0.4, 0.4, 0.4) == pytest.approx(0.4), "older ones are forgotten"


def test_more_carried_than_a_false_slip_shows_overrides_it(hand: Hand) -> None:
    lowered = hand.feel([*carry(0.2), *slip(0.25, 0.2)]).mu
    assert lowered is not None
    assert lowered < 0.25
    assert hand.feel(carry(0.26)).mu == pytest.approx(0.26), "the lower bound counts at once"
    state = hand.feel(carry(0.3))
    assert (state.mu, state.source) == (0.5, "config"), "no slip can have been there"


def test_a_slip_forgets_what_was_carried_before_it_for_the_bound_but_not_for_the_trend(hand: Hand) -> None:
    state = hand.feel([*carry(0.6), *slip(0.6, 0.4)])
    assert state.carried == pytest.approx(0.6)
    assert state.mu is not None
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


def test_a_named_object_keeps_what_was_learned_for_its_next_grasp_with_a_wider_spread(hand: Hand) -> None:
    hand.estimate.set_object("mug")
    held = hand.feel([*carry(0.35), *slip(0.4, 0.3)])
    assert held.object_name == "mug"
    kept = hand.let_go()
    assert (kept.source, kept.carried, kept.mu_d) == ("learned", None, pytest.approx(0.3))
    assert kept.mu is not None
    assert held.mu is not None
    assert 0.9 * held.mu < kept.mu < held.mu
    again = hand.feel(carry(0.2))
    assert again.mu == kept.mu
    hand.let_go()
    hand.estimate.set_object("box")
    assert hand.estimate.state.mu == 0.5
    hand.estimate.set_object("mug")
    assert hand.estimate.state.mu == kept.mu
    hand.estimate.set_object(None)
    assert (hand.estimate.state.mu, hand.estimate.state.object_name) == (0.5, None)


def test_what_a_named_object_carried_is_a_bound_for_its_next_grasp_and_a_slip_there_ends_it(hand: Hand) -> None:
    hand.estimate.set_object("mug")
    hand.feel(carry(0.8))
    assert hand.let_go().mu == pytest.approx(0.8 * math.exp(-1.645 * 0.05))
    state = hand.feel(slip(0.5, 0.4))
    assert state.mu is not None
    assert state.mu < 0.5


def test_a_grasp_of_a_known_object_disproves_what_an_earlier_one_showed(hand: Hand) -> None:
    hand.estimate.set_object("mug")
    hand.feel(slip(0.3, 0.2))
    assert hand.let_go().source == "learned"
    state = hand.feel(carry(0.4))
    assert (state.mu, state.source) == (0.5, "config")


def test_a_name_given_during_a_grasp_counts_for_all_of_it_and_another_name_starts_anew(hand: Hand) -> None:
    held = hand.feel(slip(0.4, 0.3))
    hand.estimate.set_object("mug")
    assert hand.estimate.state == held._replace(object_name="mug")
    hand.estimate.set_object("mug")
    hand.estimate.set_object("box")
    assert (hand.estimate.state.mu, hand.estimate.state.source) == (0.5, "config")
    hand.let_go()
    hand.estimate.set_object("mug")
    assert hand.estimate.state.source == "learned"


def test_the_object_not_named_for_longest_is_forgotten_when_there_are_too_many(hand: Hand) -> None:
    hand.estimate.set_object("first")
    hand.feel(slip(0.4, 0.3))
    for k in range(257):
        hand.estimate.set_object(f"object {k}")
    hand.estimate.set_object("first")
    assert hand.estimate.state.source == "config"


def test_other_coefficients_and_other_sensors_forget_everything(hand: Hand) -> None:
    hand.estimate.set_object("mug")
    hand.feel(slip(0.4, 0.3))
    hand.let_go()
    hand.estimate.restart(0.7, 0.6, "request")
    state = hand.estimate.state
    assert (state.mu, state.source, state.mu_d, state.object_name) == (0.7, "request", 0.6, "mug")
    hand.feel(slip(0.4, 0.3))
    hand.estimate.forget()
    assert hand.estimate.state == state


def test_what_was_learned_counts_from_the_next_step_of_time(hand: Hand) -> None:
    times_ns = [1_000_000_000 + k * 7_000_000 for k in range(8)]
    assert list(hand.estimate.segments(times_ns)) == [(0, 3), (3, 6), (6, 8)]
    assert list(hand.estimate.segments([1_050_000_000, 1_059_000_000])) == [(0, 2)]


@settings(max_examples=40, deadline=None)
@given(
    parts=st.lists(st.tuples(st.floats(0.05, 1.5), st.sampled_from(("carry", "slip", "creep", "lost"))), max_size=8),
    mu=st.one_of(st.none(), st.floats(0.1, 1.0)),
    sizes=st.lists(st.integers(1, 40), min_size=1, max_size=4),
)
def test_whatever_comes_the_bound_is_explained_by_evidence_and_does_not_depend_on_the_reads(
    parts: list[tuple[float, str]], mu: float | None, sizes: list[int]
) -> None:
    readings: list[Q] = []
    for q, what in parts:
        if what == "carry":
            readings += carry(q)
        elif what == "slip":
            readings += slip(q, 0.7 * q)
        else:
            readings += [(q if what == "creep" else math.nan, math.nan, math.nan, what == "creep")] * 20
    whole, split = Hand(mu), Hand(mu)
    state = whole.feel(readings) if readings else whole.estimate.state
    at = 0
    while at < len(readings):
        split.feel(readings[at : at + sizes[0]], pauses=False)
        at, sizes = at + sizes[0], [*sizes[1:], sizes[0]]
    split.pause()
    assert split.estimate.state == state
    evidence = [q for q, what in parts if what != "lost"] + ([mu] if mu is not None else [])
    if state.mu is not None:
        assert state.mu <= min(max(evidence), 1.0) * (1.0 + 1e-12)
        assert state.mu_low is not None
        assert state.mu_high is None or state.mu_low <= state.mu_high
    assert (state.mu is None) == (state.source == "none")
    if state.carried is not None:
        assert state.carried <= max(evidence) * (1.0 + 1e-12)


@pytest.mark.parametrize("seen", [slip(0.9, 0.8), [(0.9, math.nan, math.nan, True)] * 5], ids=["fall", "creep"])
def test_a_slip_without_a_known_zero_raises_nothing_either(hand: Hand, seen: list[Q]) -> None:
    state = hand.feel([*carry(0.9), *seen], raises=False)
    assert state.mu is not None
    assert state.mu <= 0.5
    assert Hand(None).feel([*carry(0.9), *seen], raises=False).source == "none", "unknown does not become safe"


def test_motion_seen_during_a_shock_raises_no_friction_beyond_what_lasted(hand: Hand) -> None:
    shock = [(1.4, math.nan, math.nan, True), *[(0.2, math.nan, math.nan, True)] * 5]
    state = hand.feel([*carry(0.2), *shock])
    assert state.mu is not None
    assert state.mu <= 0.5
    unstated = Hand(None).feel([*carry(0.2), *shock])
    assert unstated.mu is not None
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
    hand.estimate.restart(0.6, 0.55, "request")
    state = hand.feel([*carry(0.2), (0.25, 0.3, math.nan, True)])
    assert state.mu_high is not None
    assert state.mu_d is not None
    assert state.mu_d <= state.mu_high < 0.4


def test_the_least_that_is_known_of_an_object_is_what_its_next_grasp_begins_with(hand: Hand) -> None:
    assert hand.estimate.least_known == math.inf
    hand.estimate.set_object("soap")
    hand.feel(slip(0.2, 0.1))
    kept = hand.let_go().mu
    assert hand.estimate.least_known == pytest.approx(kept)
    hand.estimate.set_object("rubber")
    hand.feel(slip(0.8, 0.7))
    assert hand.estimate.least_known == pytest.approx(kept)
