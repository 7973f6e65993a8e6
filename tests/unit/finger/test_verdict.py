"""Every level says why it was reached."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from slipd.finger.verdict import SEVERITY, danger_reasons
from slipd_client.messages import LEVELS


def test_the_reason_is_what_uses_up_the_friction() -> None:
    assert danger_reasons(0.8, 0.79, 0.7) == ("translation",)
    assert danger_reasons(0.8, 0.1, 0.7) == ("rotation",)
    assert danger_reasons(0.95, 0.75, 0.7) == ("rotation", "translation")
    assert danger_reasons(math.inf, 0.1, 0.7) == ("unsupportable", "rotation")


@given(st.floats(0.0, 3.0), st.floats(0.0, 1.0))
def test_danger_never_goes_without_a_reason(utilisation: float, share: float) -> None:
    assert danger_reasons(utilisation, share * utilisation, 0.7)


def test_every_level_of_the_wire_has_its_severity() -> None:
    assert set(SEVERITY) == set(LEVELS)
    assert len(set(SEVERITY.values())) == len(LEVELS)
    assert SEVERITY["stable"] < SEVERITY["unknown"] < SEVERITY["caution"], "unknown is not no slip"
