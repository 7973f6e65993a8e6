"""The parts of a simulated grasp refuse what makes no sense, and a friction map is linear between its points."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from simulated_grasp.contact_patch import ContactPatch
from simulated_grasp.general_grasp import GeneralGrasp
from simulated_grasp.grasp_parts import FrictionLaw, FrictionMap, GraspedObject, PadCompliance
from simulated_grasp.pressure_kernels import map_factors


def grasp(**options: float) -> GeneralGrasp:
    return GeneralGrasp(
        GraspedObject(), ContactPatch(), FrictionLaw(), PadCompliance(), grip_n=1.0, largest_grip_n=1.0, **options
    )


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ContactPatch("star"), "kind must be one of"),
        (lambda: ContactPatch(half_length_m=0.0), "half lengths must be positive"),
        (lambda: ContactPatch("square", 0.01, 0.02), "a square must have one half length"),
        (lambda: ContactPatch("ring", inner=1.0), "inner must be in"),
        (lambda: ContactPatch(growth=-0.1), "growth must be in"),
        (lambda: FrictionLaw(mu_s=0.4, mu_d=0.5), "must be 0 < mu_d <= mu_s"),
        (lambda: FrictionLaw(stribeck_mps=0.0), "stribeck_mps must be > 0"),
        (lambda: FrictionMap(0.0, 0.0, 0.001, np.ones((1, 2))), "a map must be at least 2 by 2"),
        (lambda: FrictionMap(0.0, 0.0, 0.001, np.full((2, 2), math.nan)), "factor must be finite"),
        (lambda: GraspedObject(mass_kg=0.0), "mass, inertia and half lengths must be positive"),
        (lambda: PadCompliance(stiffness_n_per_m3=0.0), "stiffness must be > 0"),
        (lambda: PadCompliance(half_length_m=-1.0), "half lengths must be positive"),
        (lambda: grasp(cell_m=0.02), "cell_m must resolve the patch"),
        (lambda: grasp(step_s=0.0), "step_s must be positive"),
    ],
)
def test_parts_that_make_no_sense_are_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make()


def test_a_friction_map_is_linear_between_its_points_and_constant_beyond() -> None:
    grid = np.array(((1.0, 0.5), (0.8, 0.2)))
    points = np.array(((0.0, 0.01, 0.005, 0.005, -1.0, 1.0), (0.0, 0.0, 0.0, 0.005, -1.0, 1.0)))
    factors = np.zeros(6)
    map_factors(0.0, 0.0, 0.01, grid, points, np.ones(6), factors)
    assert factors == pytest.approx((1.0, 0.5, 0.75, 0.625, 1.0, 0.2))


def test_a_spot_is_round_and_as_large_as_its_radius() -> None:
    spot = FrictionMap.spot((0.01, 0.02), 0.006, 0.4)
    assert (1.0 - spot.factor).sum() / 0.6 * spot.cell_m**2 == pytest.approx(math.pi * 0.006**2, rel=0.02)
    assert spot.factor[0].min() == 1.0
    middle = spot.factor.shape[0] // 2
    assert spot.factor[middle, middle] == pytest.approx(0.4)
    assert (spot.x0_m + middle * spot.cell_m, spot.y0_m + middle * spot.cell_m) == pytest.approx((0.01, 0.02))
