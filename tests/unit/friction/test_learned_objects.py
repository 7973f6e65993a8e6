"""Friction kept for a named object, from grasp to grasp."""

from __future__ import annotations

import math
import random

import pytest
from learning_hand import Hand, Q, carry, slip

from slipd.friction.friction_estimate import MOST_OBJECTS

pytestmark = pytest.mark.usefixtures("both_ways")


def test_a_named_object_keeps_what_was_learned_for_its_next_grasp_with_a_wider_spread(hand: Hand) -> None:
    held = hand.feel([*carry(0.35), *slip(0.4, 0.3)])
    hand.estimate.set_object("mug")
    assert hand.estimate.state == held._replace(object_name="mug"), "a name counts for all of the grasp"
    kept = hand.let_go()
    assert (kept.source, kept.carried, kept.mu_d) == ("learned", None, pytest.approx(0.3))
    assert 0.9 * held.mu < kept.mu < held.mu
    assert hand.feel(carry(0.2)).mu == kept.mu
    for name, mu in (("mug", kept.mu), ("box", 0.5), ("mug", kept.mu), (None, 0.5)):
        hand.estimate.set_object(name)
        assert (hand.estimate.state.mu, hand.estimate.state.object_name) == (mu, name)


@pytest.mark.parametrize(
    ("first", "second", "source"),
    [
        (carry(0.8), slip(0.5, 0.4), "learned"),  # a slip ends what the object carried before
        (carry(0.8), [(0.5, 0.5, math.nan, True)] * 5, "learned"),  # also one without a plateau
        (slip(0.3, 0.2), carry(0.4), "config"),  # what it carries disproves an earlier slip
    ],
)
def test_the_next_grasp_of_an_object_may_show_otherwise(
    hand: Hand, first: list[Q], second: list[Q], source: str
) -> None:
    hand.estimate.set_object("mug")
    hand.feel(first)
    known = hand.let_go()
    assert known.source == "learned"
    if source == "learned":
        assert known.mu == pytest.approx(0.8 * math.exp(-1.645 * 0.05))
    state = hand.feel(second)
    assert (state.source, state.mu <= 0.5) == (source, True)
    assert hand.let_go().mu <= 0.5, "and the one after that begins with it"


@pytest.mark.parametrize(("others", "source"), [(MOST_OBJECTS - 1, "learned"), (MOST_OBJECTS, "config")])
def test_the_object_not_named_for_longest_is_forgotten_when_there_are_too_many(
    hand: Hand, others: int, source: str
) -> None:
    hand.estimate.set_object("first")
    hand.feel(slip(0.4, 0.3))
    for k in range(others):
        hand.estimate.set_object(f"object {k}")
    hand.estimate.set_object("first")
    assert hand.estimate.state.source == source


def test_the_least_that_is_known_of_an_object_is_what_its_next_grasp_begins_with(hand: Hand) -> None:
    assert hand.estimate.least_known == math.inf
    hand.estimate.set_object("soap")
    hand.feel(slip(0.2, 0.1))
    kept = hand.let_go().mu
    hand.estimate.set_object("rubber")
    hand.feel(slip(0.8, 0.7))
    assert hand.estimate.least_known == pytest.approx(kept)


def test_a_grasp_that_is_discarded_teaches_its_object_nothing(hand: Hand) -> None:
    hand.estimate.set_object("mug")
    before = hand.estimate.state
    hand.feel([*carry(0.3), *slip(0.4, 0.3)])
    hand.estimate.discard_grasp()
    assert hand.estimate.state == hand.let_go() == before


@pytest.mark.parametrize("seed", range(20))
def test_another_run_that_goes_on_with_a_grasp_is_never_more_lenient(seed: int) -> None:
    """Both feel the same after the first run could have been killed."""
    rng, rest = random.Random(seed), carry(0.05, 0.01)

    def course() -> list[Q]:
        peak = rng.uniform(0.1, 0.55)
        return carry(peak) if rng.random() < 0.4 else [*slip(peak, 0.8 * peak), *rest]

    killed = Hand()
    killed.estimate.set_object(rng.choice(["mug", None]))
    for _ in range(rng.randrange(1, 9)):
        killed.feel(course())
        if rng.random() < 0.2:
            killed.let_go()
    killed.feel([*slip(0.3, 0.2), *rest])
    again = Hand()
    again.estimate.set_object(killed.estimate.state.object_name)
    again.estimate.resume(killed.estimate.taught())
    assert again.estimate.state.source == "learned"
    assert again.estimate.state.mu_d == pytest.approx(killed.estimate.state.mu_d)
    for k in range(9):
        now, known = again.estimate.state.mu, killed.estimate.state.mu
        assert now <= known + 1e-12, f"after {k} more"
        more = course()
        killed.feel(more)
        again.feel(more)


def test_slips_of_another_run_come_before_those_of_this_one(hand: Hand) -> None:
    before = Hand()
    before.feel([*slip(0.2, 0.1), *carry(0.05)] * 3)
    hand.feel(slip(0.25, 0.2))
    own = hand.estimate.taught()[0].slips
    hand.estimate.resume(before.estimate.taught())
    assert hand.estimate.taught()[0].slips == (*before.estimate.taught()[0].slips, *own)
    assert hand.estimate.state.mu < 0.25  # type: ignore[operator]
