"""Load distribution of an image under each load rule."""

from __future__ import annotations

import numpy as np
import pytest

from slipd.finger.finger_state import LoadDistribution, distribute
from slipd.fusion import Contact, contact_from_wrench

X, Y = (axis.ravel() for axis in np.meshgrid(0.004 * np.arange(4.0) - 0.006, 0.004 * np.arange(4.0) - 0.006))
RAMP = np.arange(16.0) * 0.1
EVEN = np.where(RAMP > 0.0, 1.0, 0.0)
CENTROID = (0.001, 0.0005)


def contact(normal_n: float = 8.0, centroid_m: tuple[float, float] = CENTROID) -> Contact:
    force = np.array((0.0, 0.0, -normal_n))
    return contact_from_wrench(force, np.cross((*centroid_m, 0.0), force))


def distributed(rule: str, pressure: np.ndarray, pressed: Contact) -> LoadDistribution:
    return distribute(rule, X, Y, pressure, pressed)


@pytest.mark.parametrize("rule", ["grey", "binary", "matched"])
@pytest.mark.parametrize("normal_n", [8.0, 2.0])
def test_distribution_is_that_of_1_n_on_the_active_taxels(rule: str, normal_n: float) -> None:
    found = distributed(rule, RAMP, contact(normal_n))
    loads = found.loads.loads
    assert found.x.shape == found.y.shape == loads.shape == (15,), "the taxel without pressure carries nothing"
    assert loads.sum() == pytest.approx(1.0)
    assert (loads >= 0.0).all()


@pytest.mark.parametrize("rule", ["grey", "binary", "matched"])
def test_each_rule_uses_what_it_says_of_pressure_and_centroid(rule: str) -> None:
    found = distributed(rule, RAMP, contact())
    centroid = found.x @ found.loads.loads, found.y @ found.loads.loads
    assert (centroid == pytest.approx(CENTROID, abs=1e-9)) is (rule != "grey")
    by_pressure, even = RAMP[1:] / RAMP.sum(), distributed(rule, EVEN, contact()).loads.loads
    assert (found.loads.loads == pytest.approx(by_pressure)) is (rule == "grey")
    assert (found.loads.loads == pytest.approx(even, rel=0.01)) is (rule == "binary")
    unknown = contact()._replace(cx_m=np.nan, cy_m=np.nan)
    assert distributed(rule, RAMP, unknown).loads.loads == pytest.approx(by_pressure)
    assert distribute(rule, X, Y, np.zeros(16), contact()) is None
