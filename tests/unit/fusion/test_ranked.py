"""The value of a rank is that of a sorted copy."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slipd.fusion.ranked import ranked


@given(values=st.lists(st.floats(-9.0, 9.0, width=16), min_size=1, max_size=40), share=st.floats(0.0, 1.0))
def test_the_value_of_a_rank_is_that_of_sorted_values(values: list[float], share: float) -> None:
    rank, numbers = round(share * (len(values) - 1)), np.array(values)
    assert ranked(numbers.copy(), rank) == np.sort(numbers)[rank]
