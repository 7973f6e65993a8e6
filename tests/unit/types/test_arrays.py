"""Numbers that are not known become None."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.types.arrays import finite_fields, finite_list


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, np.float64(math.nan)])
def test_what_is_not_finite_is_none(value: float) -> None:
    body = {"a": value, "b": [1.0, value], "c": [1.0, 2.0], "d": 1.5, "e": ["x"], "f": [], "g": None}
    assert finite_fields(body) == {"a": None, "b": None, "c": [1.0, 2.0], "d": 1.5, "e": ["x"], "f": [], "g": None}
    assert finite_list(None) is None
    assert finite_list(np.array((1.0, value))) is None
