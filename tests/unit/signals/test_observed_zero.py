"""The zero of a pad is right where a free pad reads nothing, and wrong where it reads a load."""

from __future__ import annotations

import numpy as np
import pytest

from slipd.signals.observed_zero import HELD_NS, ObservedZero

RIGHT, WRONG, OPEN = (True, False), (False, True), (False, False)


@pytest.mark.parametrize(
    ("threshold", "readings", "found"),
    [
        (0.05, [0.05, -0.05, 0.0], RIGHT),
        (0.05, [0.06, 0.0, 0.0], OPEN),  # a hot taxel
        (0.05, [0.6, -0.6, 0.0], WRONG),
        (0.05, [0.6, 0.0, 0.0], OPEN),
        (0.0, [0.0, 0.0, 0.0], RIGHT),
        (0.0, [9.0, 9.0, 9.0], OPEN),  # no threshold: nothing says what is much
        (0.05, [np.nan, 0.0, 0.0], OPEN),
    ],
)
def test_a_free_pad_shows_its_zero_once_it_has_lasted(threshold: float, readings: list[float], found: object) -> None:
    zero = ObservedZero(threshold)
    for t_ns in (0, HELD_NS):
        zero.update(np.array(readings), t_ns, free=True)
        assert (zero.right, zero.wrong) == OPEN, "the pad may show a touch before the force sensor measures it"
    zero.update(np.array(readings), HELD_NS + 1, free=True)
    assert (zero.right, zero.wrong) == found


def test_a_pad_that_may_be_touched_shows_nothing_of_its_zero() -> None:
    zero = ObservedZero(0.05)
    for k in range(10):
        zero.update(np.zeros(3), k * HELD_NS, free=k % 2 == 0)
        assert (zero.right, zero.wrong) == OPEN
