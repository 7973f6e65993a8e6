"""250 measured pushes of a sliding object: utilisation is 1, and equation (6) as printed classifies most as safe."""

from __future__ import annotations

import numpy as np
import pytest
from chart.pushes import readings

# The friction of the board itself scatters: the spread is that of the measurement.
SPREADS = {
    "10_130_10_10_10_130": 0.105,
    "10_90_10_10_30_130": 0.08,
    "30_63.33_43.33_30_43.33_63.33": 0.24,
    "30_90_30_30_30_90": 0.08,
    "patch": 0.09,
}


def test_sliding_pushes_have_utilisation_one_within_the_scatter_of_friction_and_other_rules_miss_it() -> None:
    assert {found.layout.name: len(found.layout.wrenches) for found in readings()} == dict.fromkeys(SPREADS, 50)
    for found in readings():
        used = found.used["exact"]
        assert 0.29 < found.mu < 0.35
        assert np.median(used) == pytest.approx(1.0, abs=1e-6)
        assert used.std() < SPREADS[found.layout.name]
        assert np.median(found.used["translation"]) < 0.85, "translation alone misses part of the load"
        assert np.mean(used < 1.0) <= 0.5
        assert np.mean(found.used["(6) as printed"] <= 1.0) > 0.65, "it calls most sliding pushes safe"
