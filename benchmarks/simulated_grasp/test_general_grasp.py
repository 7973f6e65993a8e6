"""The same grasp step by step, under a load that arrives millisecond by millisecond."""

from __future__ import annotations

import math

import pytest
from simulated_grasp.contact_patch import ContactPatch
from simulated_grasp.general_grasp import GeneralGrasp
from simulated_grasp.grasp_parts import FrictionLaw, GraspedObject, PadCompliance

from slipd.tools.sim.bristle_kernels import Body
from slipd.tools.sim.scene_parts import Patch
from slipd.tools.sim.stepped_grasp import DAMPING_NS_PER_M3, STIFFNESS_N_PER_M3, SteppedGrasp

PATCH = ContactPatch("rounded", 0.018, 0.009, growth=1 / 3)
LAW = FrictionLaw()


def grasp(grip_n: float = 10.0, **options: float) -> GeneralGrasp:
    return GeneralGrasp(GraspedObject(), PATCH, LAW, PadCompliance(), grip_n=grip_n, largest_grip_n=20.0, **options)


def test_a_load_that_answers_the_motion_is_possible() -> None:
    """A hand pulls through a spring: the object slides when the spring reaches the limit, and follows the hand."""
    stepped, pulls = grasp(), []
    for i in range(1, 2001):
        pull = 800.0 * (0.02 * i * 0.001 - stepped.displacement()[0])
        pulls.append(pull)
        stepped.advance(0.001, (pull, 0.0), 0.0, 10.0)
    assert max(pulls) == pytest.approx(2 * LAW.mu_s * 10.0, rel=0.02)
    assert stepped.displacement()[0] == pytest.approx(0.04 - pulls[-1] / 800.0, abs=1e-4)


def test_the_grip_force_follows_its_command_with_the_lag() -> None:
    stepped = grasp(4.0, grip_lag_s=0.05)
    for _ in range(50):
        stepped.advance(0.001, (0.0, 0.0), 0.0, 12.0)
    assert stepped.normal_n == pytest.approx(12.0 - 8.0 * math.exp(-1.0), rel=1e-9)
    assert stepped.wrench()[2] == pytest.approx(-stepped.normal_n)


def test_the_first_touch_of_a_patch_that_grows_bears_its_force() -> None:
    stepped = grasp(0.0, grip_lag_s=0.05)
    stepped.advance(0.001, (0.0, 0.0), 0.0, 1e-3)
    assert stepped.wrench()[2] == pytest.approx(-stepped.normal_n)


def test_a_tilt_that_begins_under_load_keeps_what_the_bristles_carry() -> None:
    stepped = grasp()
    for i in range(1, 101):
        stepped.advance(0.001, (0.04 * i, 0.0), 0.0, 10.0)
    before = stepped.wrench() + stepped.wrench(right=True)
    stepped.advance(0.001, (4.0, 0.0), 0.0, 10.0, tilt_nm=(0.0, 0.02))
    assert (stepped.wrench() + stepped.wrench(right=True))[0] == pytest.approx(before[0], abs=0.1)
    assert stepped.displacement()[0] == pytest.approx(4.0 / (2 * 1.5e8 * 0.018 * 0.009 * 4), rel=0.3)


@pytest.mark.parametrize(
    ("dt_s", "fx", "grip_n"), [(0.0, 1.0, 10.0), (0.001, math.nan, 10.0), (0.001, 1.0, 21.0), (0.001, 1.0, -1.0)]
)
def test_bad_steps_are_refused(dt_s: float, fx: float, grip_n: float) -> None:
    with pytest.raises(ValueError, match="must be"):
        grasp().advance(dt_s, (fx, 0.0), 0.0, grip_n)


@pytest.mark.parametrize("force_n", [(6.0, 0.0), (0.0, 6.0), (9.0, 8.5)])
@pytest.mark.parametrize("shape", [Patch(), Patch(0.012, 0.012, exponent=2.0)])
def test_the_grasp_of_the_demo_moves_and_slides_like_this_one(shape: Patch, force_n: tuple[float, float]) -> None:
    kind = "disc" if shape.exponent == 2.0 else "rounded"
    patch = ContactPatch(kind, shape.half_length_m, shape.half_width_m, centre_m=shape.centre_m)
    held = GraspedObject(centre_of_mass_m=shape.centre_m)
    general = GeneralGrasp(held, patch, LAW, PadCompliance(), grip_n=8.0, largest_grip_n=8.0, about_m=shape.centre_m)
    cells, shares, area_m2 = shape.cells(0.001)
    law = LAW.of_cell(STIFFNESS_N_PER_M3 * area_m2, DAMPING_NS_PER_M3 * area_m2)
    plain = SteppedGrasp(law, Body(0.25, 1e-3, 0.0, 0.0), shape.centre_m, cells, shares, grip_lag_s=0.0)
    plain.normal_n = 8.0
    for i in range(1, 301):
        part = min(i / 200, 1.0)
        load = (part * force_n[0], part * force_n[1]), part * 0.01
        general.advance(0.001, *load, 8.0)
        plain.advance(0.001, *load, 8.0)
    assert plain.gross == general.gross == (math.hypot(*force_n) > 9.6)
    assert plain.carried() == pytest.approx(general.carried(), rel=0.02, abs=3e-4)
    assert plain.motion[:2] - shape.centre_m == pytest.approx(general.motion[:2] - shape.centre_m, rel=0.05, abs=1e-6)
