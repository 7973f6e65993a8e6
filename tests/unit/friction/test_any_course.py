"""Friction learned from any course of readings, in reads of any size."""

from __future__ import annotations

import math

from hypothesis import given, settings
from hypothesis import strategies as st
from learning_hand import Hand, Q, carry, slip


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
