"""The loads at which the object slides, against closed forms and the exact limit surface."""

from __future__ import annotations

import math

import numpy as np
import pytest
from simulated_grasp.contact_patch import ContactPatch
from simulated_grasp.grasp_parts import FrictionLaw
from simulated_grasp.short_loads import GRIP_N, STEADY, history, onset, ramp, simulate

from slipd.fusion import utilisation

A = 0.010
MU = STEADY.mu_s
PADS = 2


def carried_torque(patch: ContactPatch, torque_nm: float, cell_m: float) -> float:
    """The torque at which the pads together let the object turn, from a slow twist well beyond it."""
    trace = simulate(patch, STEADY, ramp((0.0, 0.0, torque_nm)), cell_m=cell_m)
    return float(np.abs(trace.wrench_left[:, 5]).max() + np.abs(trace.wrench_right[:, 5]).max())


@pytest.mark.parametrize("direction_deg", [0.0, 37.0, 90.0, 225.0])
@pytest.mark.parametrize("kind", ["disc", "rounded", "ring", "two_strips"])
def test_a_pull_slides_the_object_at_mu_times_the_normal_force(kind: str, direction_deg: float) -> None:
    pull = 2.2 * MU * GRIP_N
    towards = np.array((math.cos(math.radians(direction_deg)), math.sin(math.radians(direction_deg))))
    fx, fy = (pull * towards).tolist()
    trace = simulate(ContactPatch(kind, A), STEADY, ramp((fx, fy, 0.0)))
    assert pull * trace.t_s[onset(trace)] == pytest.approx(PADS * MU * GRIP_N, rel=0.01)
    assert trace.wrench_left[-1, :2] == pytest.approx(MU * GRIP_N * towards, abs=1e-3)


@pytest.mark.parametrize(
    ("patch", "lever_m"),
    [
        (ContactPatch("disc", A, None, exponent=0.0), 2 / 3 * A),
        (ContactPatch("disc", A, None, exponent=0.5), 3 * math.pi / 16 * A),
        (ContactPatch("ring", A, None, exponent=0.0, inner=0.6), 2 / 3 * A * (1 - 0.6**3) / (1 - 0.6**2)),
        (ContactPatch("square", A, None, exponent=0.0), A * (math.sqrt(2) + math.asinh(1)) / 3),
    ],
    ids=["uniform disc", "Hertz's disc", "ring", "square"],
)
def test_a_twist_turns_the_object_at_mu_times_the_normal_force_times_the_mean_lever(
    patch: ContactPatch, lever_m: float
) -> None:
    expected = PADS * MU * GRIP_N * lever_m
    assert carried_torque(patch, 1.6 * expected, cell_m=A / 20) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("mix", [0.15, 0.4, 0.75])
@pytest.mark.parametrize("kind", ["disc", "rectangle", "two_strips"])
def test_a_pull_and_a_twist_together_slide_the_object_on_the_exact_limit_surface(kind: str, mix: float) -> None:
    """Without a drop of the friction, a sliding object is carried with the limit; solved on a finer grid."""
    patch = ContactPatch(kind, A, 0.7 * A)
    most_n, most_nm = PADS * MU * GRIP_N, PADS * MU * GRIP_N * 0.6 * A
    load = (most_n * (1 - mix) * 0.8, most_n * (1 - mix) * 0.6, most_nm * mix)
    fine = simulate(patch, STEADY, ramp((0.0, 0.0, 0.0), 0.001), cell_m=A / 25).pressure(0)
    trace = simulate(patch, STEADY, ramp((2 * load[0], 2 * load[1], 2 * load[2]), 2.0), cell_m=A / 10)
    used = [
        utilisation(fine.x_m, fine.y_m, fine.loads_n, MU, w[:2], w[5], (0.0, 0.0)).value
        for w in trace.wrench_left[onset(trace) :: 20]
    ]
    assert used[0] > 0.975, "a core near the pole still sticks"
    assert max(used) == pytest.approx(1.0, abs=0.01)


def test_friction_falls_from_static_to_dynamic_as_the_stribeck_curve_says() -> None:
    friction = FrictionLaw(mu_s=0.6, mu_d=0.4, stribeck_mps=0.02)
    trace = simulate(ContactPatch(), friction, ramp((15.0, 0.0, 0.0)))
    speed, ratio = trace.velocity[:, 0], trace.wrench_left[:, 0] / GRIP_N
    assert ratio.max() == pytest.approx(0.6, rel=0.01)
    sliding = trace.gross & (speed > 0.2)
    assert ratio[sliding] == pytest.approx(0.4 + 0.2 / (1 + (speed[sliding] / 0.02) ** 2), abs=2e-3)


def test_a_viscous_contact_creeps_at_the_speed_of_its_law() -> None:
    """2 % above the limit, at 20 per m/s: 1 mm/s · μ."""
    friction = FrictionLaw(mu_s=0.5, mu_d=0.5, viscous_s_per_m=20.0)
    load = (1.02 * PADS * MU * GRIP_N, 0.0, 0.0)
    trace = simulate(ContactPatch(), friction, history([(0.0, 0.0, 0.0), load, load], [0.0, 0.3, 1.0]))
    assert trace.velocity[-1, 0] == pytest.approx(0.02 * MU / 20.0, rel=0.02)


def test_utilisation_is_one_when_the_object_begins_to_slide() -> None:
    trace = simulate(ContactPatch("rounded", 0.018, 0.009), STEADY, ramp((11.0, 0.0, 0.06)))
    i = onset(trace)
    assert trace.utilisation_at(np.array((i // 2, i))) == pytest.approx((0.5, 1.0), rel=0.015)
    assert trace.utilisation[i // 2] == pytest.approx(0.5, rel=0.02)
