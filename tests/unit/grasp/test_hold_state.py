"""The state of the grasp, from every pair of levels."""

from __future__ import annotations

from itertools import product

from slipd.grasp.grasp_view import HoldState
from slipd_client.messages import LEVELS

FREE, HELD, SLIPPING, BLIND = "no_contact", "stable", "slipping", "unknown"


def words(*steps: tuple[str, str, bool]) -> list[str]:
    """Return the state after each pair of levels, and whether a release was commanded."""
    state, found = HoldState(), []
    for t_ns, (first, second, releasing) in enumerate(steps, 1):
        state.update((first, second), releasing=releasing, t_ns=t_ns)
        found.append(state.word)
    return found


def test_an_object_is_held_only_by_two_pads_that_are_known_to_press() -> None:
    for first, second in product(LEVELS, LEVELS):
        [word] = words((first, second, False))
        levels = {first, second}
        if FREE in levels:
            assert word == ("unknown" if BLIND in levels else "empty")
        elif SLIPPING in levels:
            assert word == "slipping"
        else:
            assert word == ("unknown" if BLIND in levels else "held")


def test_an_object_that_leaves_without_a_release_is_lost_until_it_is_gripped_again() -> None:
    assert words((HELD, HELD, False), (HELD, FREE, False), (FREE, FREE, False), (HELD, HELD, False)) == [
        *("held", "lost", "lost", "held")
    ]


def test_an_object_that_a_release_lets_go_is_not_lost() -> None:
    steps = (HELD, HELD, False), (HELD, HELD, True), (SLIPPING, HELD, True), (FREE, HELD, False), (FREE, FREE, False)
    assert words(*steps) == ["held", "held", "slipping", "empty", "empty"]


def test_a_grip_after_a_release_can_be_lost_again() -> None:
    steps = (HELD, HELD, True), (FREE, FREE, False), (HELD, HELD, False), (FREE, FREE, False)
    assert words(*steps) == ["held", "empty", "held", "lost"]


def test_an_object_that_leaves_while_a_pad_is_not_known_is_lost() -> None:
    steps = (HELD, HELD, False), (BLIND, BLIND, False), (BLIND, FREE, False), (FREE, FREE, False)
    assert words(*steps) == ["held", "unknown", "lost", "lost"]


def test_a_loss_ends_with_the_next_release() -> None:
    assert words((HELD, HELD, False), (FREE, FREE, False), (FREE, FREE, True)) == ["held", "lost", "empty"]


def test_a_loss_keeps_its_time_until_the_next_grip() -> None:
    state = HoldState()
    steps = (HELD, HELD), (FREE, FREE), (BLIND, BLIND), (BLIND, FREE), (HELD, HELD), (BLIND, BLIND), (FREE, HELD)
    found = []
    for t_ns, levels in enumerate(steps, 1):
        state.update(levels, releasing=False, t_ns=t_ns)
        found.append((state.word, state.since_ns))
    first = [("held", 1), ("lost", 2), ("unknown", 3), ("lost", 2)]
    assert found == [*first, ("held", 5), ("unknown", 6), ("lost", 7)]


def test_a_state_has_the_time_when_it_began() -> None:
    state = HoldState()
    assert [state.update((BLIND, BLIND), releasing=False, t_ns=t_ns) for t_ns in (5, 6)] == [True, False]
    assert state.update((HELD, HELD), releasing=False, t_ns=7)
    assert not state.update((HELD, HELD), releasing=False, t_ns=8)
    assert (state.word, state.since_ns) == ("held", 7)
