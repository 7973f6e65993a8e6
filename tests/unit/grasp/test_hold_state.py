"""The state of the grasp, from every pair of levels."""

from __future__ import annotations

from itertools import product

import pytest

from slipd.grasp.grasp_view import HoldState
from slipd_client.messages import LEVELS

FREE, HELD, SLIPPING, BLIND = "no_contact", "stable", "slipping", "unknown"


def test_an_object_is_held_only_by_two_pads_that_are_known_to_press() -> None:
    for first, second in product(LEVELS, LEVELS):
        state = HoldState()
        state.update((first, second), releasing=False, t_ns=1)
        word = state.word
        levels = {first, second}
        if FREE in levels:
            assert word == ("unknown" if BLIND in levels else "empty")
        elif SLIPPING in levels:
            assert word == "slipping"
        else:
            assert word == ("unknown" if BLIND in levels else "held")


BOTH, GONE, HALF, DARK = (HELD, HELD), (FREE, FREE), (FREE, HELD), (BLIND, BLIND)
LET_GO = "releasing"


@pytest.mark.parametrize(
    "steps",
    [
        # lost until it is gripped again; not where a release lets it go, but again after that
        [(BOTH, "", "held", 1), (HALF, "", "lost", 2), (GONE, "", "lost", 2), (BOTH, "", "held", 4)],
        [
            (BOTH, "", "held", 1), (BOTH, LET_GO, "held", 1), ((SLIPPING, HELD), LET_GO, "slipping", 3),
            (HALF, "", "empty", 4), (GONE, "", "empty", 4),
        ],
        [(BOTH, LET_GO, "held", 1), (GONE, "", "empty", 2), (BOTH, "", "held", 3), (GONE, "", "lost", 4)],
        [(BOTH, "", "held", 1), (GONE, "", "lost", 2), (GONE, LET_GO, "empty", 3)],
        # lost while a pad is not known; a loss keeps its time until the next grip
        [(BOTH, "", "held", 1), (DARK, "", "unknown", 2), ((BLIND, FREE), "", "lost", 3), (GONE, "", "lost", 3)],
        [
            (BOTH, "", "held", 1), (GONE, "", "lost", 2), (DARK, "", "unknown", 3), ((BLIND, FREE), "", "lost", 2),
            (BOTH, "", "held", 5), (DARK, "", "unknown", 6), (HALF, "", "lost", 7),
        ],
    ],
)  # fmt: skip
def test_a_course_of_levels(steps: list[tuple[tuple[str, str], str, str, int]]) -> None:
    state = HoldState()
    for t_ns, (levels, releasing, word, since_ns) in enumerate(steps, 1):
        state.update(levels, releasing=bool(releasing), t_ns=t_ns)
        assert (state.word, state.since_ns) == (word, since_ns)
