"""One reading of a force/torque sensor: six numbers, returned as arrays."""

from __future__ import annotations

import numpy as np
import pytest

from slipd.types.samples import WrenchSample


@pytest.mark.parametrize("kind", [tuple, list, np.array])
def test_a_reading_returns_force_and_torque_as_arrays(kind: type) -> None:
    sample = WrenchSample(1, 2, kind((1.0, 2.0, 3.0)), kind((4.0, 5.0, 6.0)), ("skipped",), "a")
    assert sample.numbers == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert sample.force_n.tolist() == [1.0, 2.0, 3.0]
    assert sample.torque_nm is not None
    assert sample.torque_nm.tolist() == [4.0, 5.0, 6.0]
    assert sample.force_n.dtype == sample.torque_nm.dtype == np.float64


def test_a_sensor_of_three_axes_has_no_torque() -> None:
    sample = WrenchSample(1, None, (1.0, 2.0, 3.0), None)
    assert not sample.has_torque
    assert sample.torque_nm is None
    assert sample.numbers == (1.0, 2.0, 3.0, 0.0, 0.0, 0.0)
    assert repr(sample) == "WrenchSample(1, None, (1.0, 2.0, 3.0), None, (), '')"
