"""The zero of a pad is right where a free pad reads nothing, and wrong where it reads a load."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.config import Pad
from slipd.finger.pad_zero import HELD_NS, PadZero
from slipd.signals.tare import Offset

OPEN, OBSERVED = None, "observed"


def make_zero(threshold: float) -> PadZero:
    pad = Pad(device="dsacon32", port="-", rate_hz=100.0, rows=1, cols=3, pitch_m=0.003, electrode_m=0.002)
    return PadZero(pad.model_copy(update={"threshold": threshold}), (3,), np.array(1.0), None)


@pytest.mark.parametrize(
    ("threshold", "readings", "found", "keeps"),
    [
        (0.05, [0.05, -0.05, 0.0], OBSERVED, True),
        (0.05, [0.06, 0.0, 0.0], OPEN, True),  # a hot taxel
        (0.05, [0.6, -0.6, 0.0], OPEN, False),
        (0.05, [0.6, 0.0, 0.0], OPEN, True),
        (0.0, [0.0, 0.0, 0.0], OBSERVED, True),
        (0.0, [9.0, 9.0, 9.0], OPEN, True),  # no threshold: nothing says what is much
        (0.05, [math.nan, 0.0, 0.0], OPEN, True),
    ],
)
def test_a_free_pad_shows_its_zero_once_it_has_lasted(
    threshold: float, readings: list[float], found: str | None, keeps: bool
) -> None:
    """A stored zero is kept but where a free pad reads a load; an unknown one is confirmed where it reads nothing."""
    unknown, stored = make_zero(threshold), make_zero(threshold)
    stored.tare.restore(Offset(1, np.zeros(3), -1, 9, "somebody", np.zeros(3), None, "stored"))
    for t_ns in (0, HELD_NS, HELD_NS + 1):
        assert (unknown.known, stored.known) == (False, True), "the pad may show a touch before the force sensor does"
        for zero in (unknown, stored):
            zero.judge(np.array(readings), t_ns, free=True)
    assert (unknown.origin, unknown.tared, stored.known) == (found, found is not None, keeps)


def test_a_pad_that_may_be_touched_shows_nothing_of_its_zero() -> None:
    zero = make_zero(0.05)
    for k in range(10):
        zero.judge(np.zeros(3), k * HELD_NS, free=k % 2 == 0)
    assert not zero.known
