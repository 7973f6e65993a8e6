"""Friction learned in one contact, from rows of readings, and friction against rotation."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from learning_hand import STEP_S, Hand, Q, carry, slip

from slipd.friction.friction_state import LEAST_SHARE, ONSET_S, FrictionState, RotationFriction
from slipd.fusion.rows import FREE, UNTRUSTED

pytestmark = pytest.mark.usefixtures("both_ways")

NAN = math.nan
CREEP: list[Q] = [(0.45, NAN, NAN, True)] * 5
"""Motion without a drop of the load."""
PRIOR, ONE_SLIP = math.exp(1.645 * 0.1), math.exp(1.645 * math.sqrt(2) * 0.05)
"""Half-widths of the intervals, as factors: of the stated coefficient, and of the next slip after one."""
Course = list[tuple[list[Q], dict[str, Any]]]


@pytest.mark.parametrize(
    ("hand", "course", "expected"),
    [
        ({}, [], {"mu": 0.5, "source": "config", "mu_low": 0.5 / PRIOR, "mu_high": 0.5 * PRIOR, "mu_d": None}),
        # What lasts becomes the lower bound where it is larger, and stays that.
        ({}, [(carry(0.4), {})], {"mu": 0.5, "source": "config", "carried": 0.4}),
        ({}, [(carry(0.6), {})], {"mu": 0.6, "source": "learned", "mu_low": 0.6, "mu_high": 0.6 * PRIOR}),
        ({}, [(carry(0.6), {}), (carry(0.3), {})], {"mu": 0.6, "carried": 0.6}),
        ({}, [([*carry(0.2), *carry(0.6, 0.05), *carry(0.2)], {})], {"carried": 0.2}),
        # Noise, few readings and few taxels lower the bound.
        ({}, [(carry(0.6), {"ratio": 0.2, "shape": 0.1})], {"mu": 0.6 * math.exp(-1.645 * 0.08)}),
        # Nothing of a prior that is a fifth too high survives a slip: one slip's scatter, and that of the next.
        (
            {}, [([*carry(0.35), *slip(0.5 / 1.2, 0.35)], {})],
            {"mu": 0.5 / 1.2 / ONE_SLIP, "source": "learned", "mu_high": 0.5 / 1.2 * ONE_SLIP, "mu_d": 0.35},
        ),
        # More carried than a false slip shows overrides it: first the lower bound, then no slip can have been there.
        ({}, [([*carry(0.2), *slip(0.25, 0.2)], {}), (carry(0.26), {})], {"mu": 0.26, "source": "learned"}),
        ({}, [([*carry(0.2), *slip(0.25, 0.2)], {}), (carry(0.3), {})], {"mu": 0.5, "source": "config"}),
        # Motion without a drop of the load gives a rough sample.
        (
            {"mu": None}, [([*carry(0.45), *CREEP], {})],
            {"mu": 0.45 * math.exp(-1.645 * math.sqrt(0.015)), "source": "learned", "mu_d": None},
        ),
        ({"mu": None}, [(carry(0.6), {})], {"mu": None, "source": "none", "mu_low": 0.6, "mu_high": None}),
        # A coefficient that is known exactly is not learned, and nothing raises one beyond the largest allowed.
        (
            {"spread": 0.0}, [([*carry(0.6), *slip(0.4, 0.3)], {})],
            {"mu": 0.5, "source": "config", "mu_low": 0.5, "mu_high": 0.5, "mu_d": 0.3},
        ),
        ({"most": 0.7}, [(carry(0.9), {})], {"mu": 0.7}),
        ({"most": 0.7}, [(slip(0.9, 0.8), {})], {"mu": 0.7}),
        ({"mu": None, "most": 0.3}, [(slip(0.9, 0.8), {})], {"mu": 0.3}),
        # Readings that are not trusted teach nothing and interrupt the dwell.
        ({}, [(carry(0.4), {}), ([*carry(0.8), *slip(0.3, 0.2)], {"phase": UNTRUSTED})], {"mu": 0.5, "carried": 0.4}),
        ({}, [(carry(0.4), {}), ([*carry(0.8), *slip(0.3, 0.2)], {"teaches": False})], {"mu": 0.5, "carried": 0.4}),
        (
            {}, [(carry(0.6, 0.09), {}), (carry(0.6, STEP_S), {"phase": UNTRUSTED}), (carry(0.6, 0.09), {})],
            {"carried": None},
        ),
        (
            {}, [(carry(0.6, 0.09), {}), (carry(0.6, STEP_S), {"teaches": False}), (carry(0.6, 0.09), {})],
            {"carried": None},
        ),
    ],
)  # fmt: skip
def test_what_a_course_teaches(hand: dict[str, Any], course: Course, expected: dict[str, Any]) -> None:
    felt = Hand(**hand)
    for readings, how in course:
        felt.feel(readings, **how)
    found = felt.estimate.state._asdict()
    for name, value in expected.items():
        assert found[name] == (pytest.approx(value) if isinstance(value, float) else value), name


@pytest.mark.parametrize(("pause_s", "seconds", "times", "carried"), [(1.0, 0.06, 2, None), (0.095, STEP_S, 5, 0.6)])
def test_a_gap_in_the_readings_is_not_carried_but_ten_a_second_are_enough(
    hand: Hand, pause_s: float, seconds: float, times: int, carried: float | None
) -> None:
    for _ in range(times):
        state = hand.feel(carry(0.6, seconds))
        hand._t_s += pause_s
    assert state.carried == (None if carried is None else pytest.approx(carried))


SHOCK: list[Q] = [(1.4, NAN, NAN, True), *[(0.2, NAN, NAN, True)] * 5]
"""Motion that is seen during a shock."""


def test_courses_are_ordered_by_what_they_show_of_friction() -> None:
    def mu(course: list[Q], stated: float | None = 0.5, **how: float) -> Any:
        return Hand(stated).feel(course, **how).mu

    # noise lowers the bound less than few taxels do
    assert mu(carry(0.6), ratio=0.2, shape=0.1) < mu(carry(0.6), noise=0.06) < mu(carry(0.6))
    assert Hand().feel(carry(0.6), noise=0.06).carried == pytest.approx(0.6), "what was carried is a mean, no bound"
    # a slip inside the interval of the prior is combined with it
    assert mu(slip(0.47, 0.4), None) < mu(slip(0.47, 0.4)) < 0.47
    # a slip forgets what was carried before it for the bound, but not for the trend
    state = Hand().feel([*carry(0.6), *slip(0.6, 0.4)])
    assert (state.carried, state.mu < 0.57) == (pytest.approx(0.6), True)
    # a shock raises no friction beyond what lasted
    assert mu([*carry(0.2), *SHOCK]) <= 0.5
    assert mu([*carry(0.2), *SHOCK], None) <= 0.2
    assert mu(SHOCK, None) is None, "nothing lasted"


def test_slips_that_agree_narrow_the_interval_and_newer_ones_weigh_more() -> None:
    def interval(*peaks: float) -> tuple[float, float]:
        """Return width and middle, as factor and geometric mean."""
        hand = Hand(None)
        for peak in peaks:
            state = hand.feel([*carry(0.2), *slip(peak, 0.2)])
        return state.mu_high / state.mu_low, math.sqrt(state.mu_low * state.mu_high)

    assert interval(0.5, 0.5, 0.5)[0] < interval(0.5)[0] < interval(0.5, 0.35)[0]
    assert interval(0.5, 0.45)[1] < math.sqrt(0.5 * 0.45) < interval(0.45, 0.5)[1]
    assert interval(*[0.5] * 9, 0.4, 0.4, 0.4, 0.4)[1] == pytest.approx(0.4), "older ones are forgotten"


def test_what_was_carried_overrides_only_the_slips_that_it_disproves() -> None:
    hand, other = Hand(None), Hand(None)
    hand.feel([*carry(0.2), *slip(0.25, 0.2)])
    for each in (hand, other):
        each.feel([*carry(0.3), *slip(0.5, 0.4)])
        each.feel(carry(0.45))
    found, expected = hand.estimate.state, other.estimate.state
    assert (found.mu, found.mu_low, found.mu_high) == (expected.mu, expected.mu_low, expected.mu_high)
    assert found.source == "learned"


def test_one_slip_gives_one_sample_however_long_it_lasts() -> None:
    once, hand = Hand(None).feel(slip(0.5, 0.4)), Hand(None)
    hand.feel(slip(0.5, 0.4))
    chattering = hand.feel(slip(0.42, 0.4))
    assert (chattering.mu_low, chattering.mu_high) == (once.mu_low, once.mu_high)
    creeping = Hand(None)
    creeping.feel([*carry(0.45), *CREEP])
    assert creeping.feel(slip(0.5, 0.4)) == Hand(None).feel([*carry(0.45), *slip(0.5, 0.4)]), "a peak replaces a creep"


def test_the_end_of_the_contact_starts_anew(hand: Hand) -> None:
    fresh = hand.estimate.state
    for course in ([*carry(0.6), *slip(0.4, 0.3)], carry(0.6)):
        hand.feel(course)
        assert hand.let_go() == fresh
    assert hand.feel(carry(0.6, 0.09)).carried is None, "one part of a dwell"
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
        hand.feel([*slip(q, 0.8 * q), *carry(0.95 * q)])
        if lets_go:
            hand.let_go()
    strict = hand.estimate.state
    assert strict.mu < 0.3
    hand.estimate.doubt()
    assert (hand.estimate.state.mu, hand.estimate.state.carried) == (pytest.approx(strict.mu, rel=0.1), None)
    assert (hand.estimate.least_known < 0.3) is lets_go
    hand.estimate.set_object("tyre")
    assert (hand.estimate.state.mu, hand.estimate.state.source) == (0.5, "config"), "a zero that is wrong by more"


def test_what_was_learned_counts_from_the_next_step_of_time(hand: Hand) -> None:
    times_ns = [1_000_000_000 + k * 7_000_000 for k in range(8)]
    assert [hand.estimate.begin_step(times_ns, begin) for begin in (0, 3, 6)] == [3, 6, 8]
    assert hand.estimate.begin_step([1_050_000_000, 1_059_000_000], 0) == 2


def test_a_long_time_without_trusted_readings_ends_what_was_learned(hand: Hand) -> None:
    """Another object may be in the grip by then."""
    fresh = hand.estimate.state
    assert hand.feel(carry(0.8)).mu == pytest.approx(0.8)
    hand.feel(carry(0.8, 0.2), phase=UNTRUSTED)
    assert hand.feel(carry(0.1)).mu == pytest.approx(0.8)
    hand.feel(carry(0.8, 0.4), phase=UNTRUSTED)
    assert hand.feel(carry(0.1, 0.02)) == fresh


def stay(_: Hand) -> None:
    """What the config states holds."""


def state_more(hand: Hand) -> None:
    """A client states a small fall."""
    hand.estimate.set(0.5, 0.49, "ann", None)


def carry_more(hand: Hand) -> None:
    hand.feel(carry(0.6))


def slip_at(q: float) -> Callable[[Hand], object]:
    return lambda hand: hand.feel(slip(q, 0.8 * q))


def slippery_before(hand: Hand) -> None:
    """A named object slipped, and another one is in the grip now."""
    hand.estimate.set_object("soap")
    slip_at(0.3)(hand)
    hand.estimate.set_object("rubber")


@pytest.mark.parametrize(
    ("stated", "before", "strictest", "given", "lenient"),
    [
        *((0.5, stay, 0.5, given, False) for given in ((0.5, None), (0.4, None), (0.5, 0.4), (0.4, 0.1))),
        (0.5, stay, 0.5, (0.6, None), True),
        (None, stay, None, (0.1, None), True),
        # a larger fall than one set before
        (0.5, state_more, 0.5, (0.5, 0.4), True),
        (0.5, state_more, 0.5, (0.5, 0.49), False),
        # what a grasp taught beyond the stated mu ends with it, what it taught below counts, and so does another object
        (0.5, carry_more, 0.5, (0.55, None), True),
        (0.5, carry_more, 0.5, (0.5, None), False),
        (0.5, slip_at(0.3), 0.3 / ONE_SLIP, (0.5, None), True),
        (0.5, slip_at(0.3), 0.3 / ONE_SLIP, (0.2, None), False),
        (None, slip_at(0.5), None, (0.1, None), True),
        (0.5, slippery_before, 0.3 * math.exp(-1.645 * math.sqrt(0.0075)), (0.5, None), True),
        (0.5, slippery_before, 0.3 * math.exp(-1.645 * math.sqrt(0.0075)), (0.2, None), False),
    ],
)
def test_what_is_more_lenient_than_what_is_in_use_or_known(
    stated: float | None, before: Callable[[Hand], None], strictest: float | None, given: Any, lenient: bool
) -> None:
    hand = Hand(stated)
    before(hand)
    assert hand.estimate.strictest == (None if strictest is None else pytest.approx(strictest))
    assert hand.estimate.is_more_lenient(*given) is lenient


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        (
            0.5,
            [
                (0.5, 0.5894018, None, 0.35), (0.4426123, 0.5877428, 0.4, 0.35), (0.4270548, 0.5597448, 0.4, 0.35),
                (0.4314839, 0.5351118, 0.3651044, 0.35), (0.4379246, 0.5591749, 0.400395, 0.35),
                (0.4202829, 0.5774523, 0.400395, None), (0.55, 0.5774523, 0.400395, 0.55),
                (0.303814, 0.526638, 0.33, 0.55),
            ],
        ),
        (
            None,
            [
                (None, None, None, 0.35), (0.4335237, 0.6237259, 0.4, 0.35), (0.1410242, 0.6812596, 0.4, 0.35),
                (0.4257602, 0.5330462, 0.3651044, 0.35), (0.4300409, 0.5643494, 0.400395, 0.35),
                (0.4202829, 0.5774523, 0.400395, None), (0.55, 0.5774523, 0.400395, 0.55),
                (0.303814, 0.526638, 0.33, 0.55),
            ],
        ),
    ],
)  # fmt: skip
def test_the_numbers_of_a_grasp_with_slips_and_noise_keep_their_digits(
    stated: float | None, expected: list[tuple[float | None, ...]]
) -> None:
    """Bound, upper bound, dynamic friction and what was carried, after each part."""
    hand, found = Hand(stated), []
    hand.estimate.set_object("mug")
    for part, how in (
        (carry(0.35), {"noise": 0.02}), (slip(0.52, 0.4), {"noise": 0.03, "ratio": 0.6, "shape": 0.1}),
        ([*carry(0.2), *CREEP], {"shape": 0.05, "ratio": 0.3}), (slip(0.47, 0.36), {}),
        ([*carry(0.2), *slip(0.61, 0.5), *carry(0.3), *slip(0.43, 0.35, 0.15), *carry(0.2), *slip(0.5, 0.41)], {}),
        (carry(math.nan, STEP_S), {"phase": FREE}), (carry(0.55), {}), (slip(0.4, 0.33), {"noise": 0.05}),
    ):  # fmt: skip
        state = hand.feel(part, **how)
        found.append((state.mu, state.mu_high, state.mu_d, state.carried))
    for numbers, known in zip(found, expected, strict=True):
        assert numbers == pytest.approx(known, abs=1e-6)


def test_dynamic_friction_is_never_above_the_interval_of_static_friction(hand: Hand) -> None:
    hand.estimate.set(0.6, 0.55, "ann", None)
    state = hand.feel([*carry(0.2), (0.25, 0.3, math.nan, True)])
    assert state.mu_d <= state.mu_high < 0.4


STATED = 0.08
REPORTED_S = 0.3


def turn(rotation: RotationFriction, t_s: float, required: float) -> None:
    """Turn the object at a spin that has just sunk to half."""
    rotation.carry(t_s - 0.1, required)
    rotation.carry(t_s, 0.5 * required)
    rotation.slip(t_s + REPORTED_S)


@pytest.mark.parametrize(
    ("turns", "learned"),
    [
        ([], None),
        ([(1.0, 0.06)], 0.06),
        ([(1.0, 0.06), (1.2, 0.07), (1.4, 0.05)], 0.07),  # a turn that goes on is one sample
        ([(1.0, 0.10), (5.0, 0.05)], (0.05 * 0.10**0.6) ** (1 / 1.6)),  # the newest weighs most
        ([(1.0, 0.99 * LEAST_SHARE * STATED)], None),  # a slip with little spin is a translation
        ([(1.0, 0.99 * LEAST_SHARE * STATED), (1.2, 0.06)], 0.06),
        ([(1.0, math.nan), (5.0, 0.06)], 0.06),  # a sensor that measured no torque
    ],
)
def test_the_largest_spin_before_a_turn_was_the_limit(turns: list[tuple[float, float]], learned: float | None) -> None:
    rotation, calibrated = RotationFriction(STATED), RotationFriction(None)
    for each in (rotation, calibrated):
        each.slip(0.1)
        each.carry(1.0 - ONSET_S - 0.11, 0.2)  # too long before
        for t_s, required in turns:
            turn(each, t_s, required)
    assert rotation.learned == (None if learned is None else pytest.approx(learned))
    assert calibrated.learned is None, "calibrated taxels learn nothing here"
    rotation.forget()
    rotation.slip(9.0)
    assert rotation.learned is None, "the grasp ended"


def test_a_spin_uses_more_friction_than_mu_says_and_never_less() -> None:
    assert FrictionState(0.32).spin_scale == 1.0
    assert FrictionState(None, mu_rotation=0.08).spin_scale == 1.0
    assert FrictionState(0.32, mu_rotation=0.08).spin_scale == pytest.approx(4.0)
    assert FrictionState(0.32, mu_rotation=0.40).spin_scale == 1.0


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
        assert state.mu_high is None or state.mu_low <= state.mu_high
    assert (state.mu is None) == (state.source == "none")
    if state.carried is not None:
        assert state.carried <= max(evidence) * (1.0 + 1e-12)
