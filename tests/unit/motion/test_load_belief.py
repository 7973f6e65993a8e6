"""Belief that the object moves, from the load alone."""

from __future__ import annotations

import pytest

from slipd.motion.load_belief import AHEAD, BELIEF_AT_LIMIT, LoadBelief


def test_the_belief_grows_with_the_larger_of_the_two_utilisations() -> None:
    assert LoadBelief().update(0.2, 0.5) == pytest.approx(0.5 * BELIEF_AT_LIMIT)
    assert LoadBelief().update(-0.8, 0.5) == pytest.approx(0.8 * BELIEF_AT_LIMIT)


def test_a_load_that_grows_is_extrapolated() -> None:
    belief = LoadBelief()
    belief.update(-0.2, 0.0)
    assert belief.update(-0.6, 0.0) == pytest.approx((0.6 + AHEAD * 0.4) * BELIEF_AT_LIMIT)


def test_what_was_carried_adds_no_belief_until_the_object_moved() -> None:
    belief = LoadBelief()
    for _k in range(3):
        belief.update(0.7, 0.7)
    assert belief.update(0.5, 0.5) == 0.0
    assert belief.update(0.9, 0.9) > BELIEF_AT_LIMIT * 0.9
    belief.forget_carried()
    assert belief.update(0.9, 0.9) == pytest.approx(BELIEF_AT_LIMIT * 0.9)


def test_a_load_of_the_last_look_but_one_has_not_been_carried_yet() -> None:
    belief = LoadBelief()
    belief.update(0.7, 0.7)
    belief.update(0.5, 0.5)
    assert belief.update(0.5, 0.5) == 0.0  # the first one has by now
    fresh = LoadBelief()
    fresh.update(0.7, 0.7)
    assert fresh.update(0.5, 0.5) > 0.0


def test_a_new_grasp_begins_anew() -> None:
    belief = LoadBelief()
    for _k in range(4):
        belief.update(0.9, 0.9)
    belief.forget()
    assert belief.update(0.4, 0.4) == pytest.approx(0.4 * BELIEF_AT_LIMIT)
