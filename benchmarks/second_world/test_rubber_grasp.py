"""The second contact model at its limits: what must hold whatever is drawn."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from evaluate.finger_sensing import FingerSensing
from evaluate.scene import STEP_S
from second_world.rubber_grasp import Rubber, RubberGrasp, gaps_of
from second_world.rubber_kernels import HEAT, LOST, VISCOUS, WORK
from second_world.rubber_scene import RubberScene
from simulated_grasp.contact_patch import KINDS, ContactPatch
from simulated_grasp.grasp_parts import FrictionLaw, FrictionMap, GraspedObject, PadCompliance

GRIP_N, MU_S, MU_D = 10.0, 0.6, 0.48
LIMIT_N = 2.0 * MU_S * GRIP_N
PLAIN = Rubber(rate=0.0)
PATCH = ContactPatch("rounded", 0.006, 0.005)


def grasp(rubber: Rubber = PLAIN, *, mass: float = 0.3, patch: ContactPatch = PATCH, **law: object) -> RubberGrasp:
    friction = FrictionLaw(mu_s=MU_S, mu_d=MU_D, **law)
    closed = np.full(2, GRIP_N)
    held = GraspedObject(mass, mass * 0.025**2)
    scene = RubberScene(
        held, patch, friction, PadCompliance(1e8), np.zeros((2, 3)), closed, FingerSensing(), "safe", 0.0, rubber=rubber
    )
    found = scene.grasp()
    found.press(GRIP_N, math.inf)
    return found


def run(found: RubberGrasp, seconds: float, load: tuple[float, float, float], grip_n: float = GRIP_N) -> list[float]:
    """Apply a load for a time; return the tangential force on one finger at every step."""
    forces = []
    for _ in range(round(seconds / STEP_S)):
        found.advance(STEP_S, load, grip_n)
        forces.append(float(np.hypot(*found.wrench()[:2])))
    return forces


def test_below_the_limit_only_the_rim_slides() -> None:
    found = grasp()
    for k in range(1, 61):
        run(found, STEP_S, (0.01 * k * LIMIT_N, 0.0, 0.0))
    forces = run(found, 0.2, (0.6 * LIMIT_N, 0.0, 0.0))
    assert forces[-1] == pytest.approx(0.3 * LIMIT_N, rel=0.01)
    assert found.gross_share < 0.5
    assert np.abs(found.slid[:2]).max() < 5e-5
    assert abs(found.displacement()[0]) > 5e-5, "the pads are elastic"


@pytest.mark.parametrize("part", [0.5, 0.75])
def test_partial_slip_of_a_round_pad_follows_the_closed_form(part: float) -> None:
    """With a paraboloid of independent springs the load is 2 s − s² of the limit at the share s of the displacement."""
    smooth = Rubber(branch=(1e-3, 1e-3), distance_m=1.0, rate=0.0, roughness=1e-6, scatter=0.0)
    found = grasp(smooth, patch=ContactPatch("disc", 0.008, 0.008))
    for k in range(1, 201):
        run(found, STEP_S, (part * LIMIT_N * k / 200, 0.0, 0.0))
    run(found, 0.1, (part * LIMIT_N, 0.0, 0.0))
    most_m = MU_S * 2.0 * GRIP_N / (math.pi * 0.008**2) / 1e8
    assert found.displacement()[0] / most_m == pytest.approx(1.0 - math.sqrt(1.0 - part), rel=0.05)


def test_above_the_limit_it_slides_and_friction_is_the_dynamic_one() -> None:
    found = grasp()
    forces = run(found, 0.1, (1.3 * LIMIT_N, 0.0, 0.0))
    assert 1.08 * MU_D * GRIP_N < max(forces) < 1.01 * MU_S * GRIP_N, "the rim has weakened before the rest slides"
    assert forces[-1] == pytest.approx(MU_D * GRIP_N, rel=0.01)
    assert found.gross_share == pytest.approx(1.0)
    assert found.slid[0] == pytest.approx(found.displacement()[0], abs=1e-3)


def test_an_object_that_stopped_holds_what_it_did_not_hold_while_it_slid() -> None:
    """Junctions heal while they rest."""
    found = grasp()
    between = (0.25 * MU_S + 0.75 * MU_D) * 2.0 * GRIP_N
    run(found, 0.03, (1.2 * LIMIT_N, 0.0, 0.0))
    sliding = abs(found.slid[0])
    run(found, 0.05, (between, 0.0, 0.0))
    assert abs(found.slid[0]) > 2.0 * sliding, "the load is above dynamic friction"
    run(found, 0.4, (0.0, 0.0, 0.0))
    rested = found.slid[0]
    for part in np.linspace(0.0, 1.0, 100).tolist():
        run(found, STEP_S, (part * between, 0.0, 0.0))
    run(found, 0.1, (between, 0.0, 0.0))
    assert found.slid[0] - rested < 1e-4


def test_a_turned_pad_springs_back_at_once_and_then_creeps_back() -> None:
    found = grasp(Rubber(branch=(0.8, 0.3), relax_s=(0.3, 0.8), rate=0.0))
    torque = 0.1 * LIMIT_N * 0.005
    run(found, 1.0, (0.0, 0.0, torque))
    turned = found.displacement()[2]
    assert turned > math.radians(0.3)
    run(found, 0.15, (0.0, 0.0, 0.0))
    soon = found.displacement()[2]
    run(found, 1.5, (0.0, 0.0, 0.0))
    assert 0.05 < soon / turned < 0.7
    assert abs(found.displacement()[2]) < 0.05 * turned


@pytest.mark.parametrize("load", [(0.9 * LIMIT_N, 2.0, 0.01), (1.4 * LIMIT_N, -3.0, 0.05)], ids=["holds", "slides"])
def test_no_energy_is_created(load: tuple[float, float, float]) -> None:
    found = grasp(Rubber())
    spent = np.zeros(4)
    for k in range(200):
        found.advance(STEP_S, load, GRIP_N * (1.0 - 0.3 * (k > 100)))
        now, stored, moving = found.energy()
        assert (now[[HEAT, VISCOUS, LOST]] >= spent[[HEAT, VISCOUS, LOST]]).all()
        assert stored >= 0.0
        balance = now[WORK] - now[HEAT] - now[VISCOUS] - now[LOST] - stored - moving
        assert abs(balance) < 0.03 * max(abs(now[WORK]), 1e-4)
        spent = now


def test_pressure_carries_the_grip_and_spreads_while_the_pads_creep() -> None:
    found = grasp()
    found.press(0.0, math.inf)
    found.press(GRIP_N, STEP_S)
    assert found.loads.sum() == pytest.approx(GRIP_N)
    first = (found.loads > 0.0).sum(), found.gyration_m()
    for _ in range(200):
        found.press(GRIP_N, 0.05)
    assert found.loads.sum() == pytest.approx(GRIP_N)
    assert (found.loads > 0.0).sum() > first[0]
    assert found.gyration_m() != first[1]
    found.press(0.0, STEP_S)
    assert not found.loads.any()


def test_a_wet_patch_lowers_the_friction_where_the_object_is_wet() -> None:
    found = grasp(wet=FrictionMap.spot((0.003, 0.0), 0.002, 0.5))
    wet = np.hypot(found.places[0] - 0.003, found.places[1]) < 0.0015
    assert found.factors[wet].mean() < 0.65 * found.factors[found.places[0] < 0.0].mean()


@pytest.mark.parametrize("kind", KINDS)
def test_every_shape_touches_inside_and_not_outside(kind: str) -> None:
    patch = replace(PATCH, kind=kind, half_width_m=None)
    middle = 0.5 * (1.0 + patch.inner)
    inside = {"ring": (0.0, middle), "two_strips": (0.0, middle), "edge": (0.8, 0.0)}.get(kind, (0.0, 0.0))
    assert gaps_of(patch, *(np.array((part,)) for part in inside)).item() < 0.2
    assert gaps_of(patch, np.array((1.3,)), np.array((1.3,))).item() > 1.0
