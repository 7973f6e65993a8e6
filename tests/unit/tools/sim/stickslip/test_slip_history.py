"""What happens before, during and after a slip."""

from __future__ import annotations

import numpy as np
import pytest
from stick_slip_scenes import BOX, GRIP_N, PAD, STEADY, history, kinetic_j, onset, ramp, simulate

from slipd.tools.sim.stickslip import ContactPatch, FrictionLaw, GraspedObject

NOTHING = (0.0, 0.0, 0.0)
PATCH = ContactPatch("rounded", 0.018, 0.009)
DROPS = FrictionLaw(mu_s=0.6, mu_d=0.45)


def test_the_rim_slides_before_the_object_does_and_the_object_stops_there() -> None:
    """A load of 80 % of the limit and back: part of the contact slides, the object creeps by microns and holds."""
    load = (0.8 * 12.0, 0.0, 0.0)
    trace = simulate(PATCH, DROPS, history([NOTHING, load, load, NOTHING, NOTHING], [0.0, 0.4, 0.7, 1.1, 1.4]))
    up, held = (trace.t_s > 0.2) & (trace.t_s < 0.4), (trace.t_s > 0.6) & (trace.t_s < 0.7)
    assert not trace.gross.any()
    assert 0.05 < trace.sliding_share[up].max() < 0.5
    assert trace.sliding_share[held].max() == 0.0
    elastic = load[0] / (2 * PAD.stiffness_n_per_m3 * len(trace.contact.cells.T) * trace.contact.cell_m**2)
    assert elastic < trace.displacement[650, 0] < 2 * elastic
    assert 0.0 < trace.displacement[-1, 0] < 0.3 * elastic, "the rim keeps a part of the micro-slip"


def test_a_load_below_the_limit_does_not_make_the_object_drift_however_often_it_comes_back() -> None:
    t = np.arange(2001) * 0.001
    load = [(6.0 + 2.5 * np.sin(2 * np.pi * 10.0 * s), 0.0, 0.0) for s in t]
    trace = simulate(PATCH, DROPS, history([NOTHING, *load], [0.0, *(t + 0.5)]))
    assert not trace.gross.any()
    assert trace.displacement[2400, 0] == pytest.approx(trace.displacement[1400, 0], abs=1e-8)


def test_a_sliding_object_sticks_again_when_the_grip_is_raised() -> None:
    load = (11.0, 0.0, 0.0)
    times = [0.0, 0.3, 0.4, 0.43, 0.44, 1.0]
    trace = simulate(PATCH, DROPS, history([NOTHING, load, load, load, load, load], times, [10, 10, 9, 9, 25, 25]))
    began = onset(trace)
    assert 0.3 < trace.t_s[began] < 0.44
    assert not trace.gross[-400:].any()
    assert trace.velocity[-1] == pytest.approx(0.0, abs=1e-6)
    assert trace.displacement[-1, 0] > 20e-6 + trace.displacement[began, 0]
    assert trace.wrench_left[-1, 0] == pytest.approx(5.5, rel=1e-4)


@pytest.mark.parametrize(
    "load",
    [(7.0, 0.0, 0.0), (14.0, 0.0, 0.0), (6.0, 0.0, 0.12), (0.0, -8.0, 0.0)],
    ids=["held", "pulled", "turned", "jolted"],
)
def test_what_the_load_does_is_dissipated_stored_or_kinetic(load: tuple[float, float, float]) -> None:
    seconds = 0.002 if load[1] else 0.3
    trace = simulate(PATCH, DROPS, history([NOTHING, load, NOTHING, load], [0.0, seconds, 0.4, 0.6]))
    work, slid, damped, stored = trace.energy[-1]
    assert min(slid, damped) >= 0.0
    assert work == pytest.approx(slid + damped + stored + kinetic_j(trace), rel=0.01)


def test_an_object_beyond_the_grip_falls_freely() -> None:
    box = GraspedObject(mass_kg=0.25, half_length_m=0.03, half_width_m=0.03)
    weight = (0.25 * 9.81, 0.0, 0.0)
    trace = simulate(PATCH, DROPS, history([NOTHING, weight, weight], [0.0, 0.2, 0.5], [10, 0.5, 0.5]), held=box)
    assert trace.displacement[-1, 0] > 0.05
    assert trace.wrench_left[-1] == pytest.approx(0.0)
    assert not trace.gross[-1]
    fall = np.diff(trace.velocity[-40:, 0]) / np.diff(trace.t_s[-40:])
    assert fall == pytest.approx(9.81, rel=1e-9)
    assert trace.pressure(-1).loads_n.sum() == 0.0


def test_an_object_without_a_grip_falls_freely() -> None:
    trace = simulate(PATCH, DROPS, history([NOTHING, (1.0, 0.0, 0.0)], [0.0, 0.1], 0.0))
    assert trace.velocity[-1, 0] == pytest.approx(0.5 * 1.0 * 0.1 / BOX.mass_kg, rel=1e-6)


def test_the_same_scene_gives_the_same_trace() -> None:
    a, b = (simulate(PATCH, DROPS, ramp((14.0, 3.0, 0.05), 0.3)) for _ in range(2))
    for name in ("wrench_left", "wrench_right", "displacement", "velocity", "sliding_share", "gross", "energy"):
        assert np.array_equal(getattr(a, name), getattr(b, name))


def test_a_light_object_is_stepped_finely_enough() -> None:
    light = GraspedObject(mass_kg=0.002, inertia_kgm2=1e-6)
    trace = simulate(PATCH, DROPS, history([NOTHING, *[(6.0, 0.0, 0.0)] * 2], [0.0, 0.1, 0.2]), held=light)
    assert not trace.gross.any()
    assert trace.wrench_left[-50:, 0] == pytest.approx(3.0, rel=1e-3)


def test_the_velocity_is_the_rate_of_the_displacement() -> None:
    held = GraspedObject(centre_of_mass_m=(0.03, -0.02))
    trace = simulate(PATCH, DROPS, history([NOTHING, (13.0, 4.0, 0.15)], [0.0, 0.4]), held=held)
    rate = np.gradient(trace.displacement, trace.t_s, axis=0)
    late = slice(-60, -2)
    assert np.abs(trace.displacement[-1]).min() > 0.002
    assert trace.velocity[late] == pytest.approx(rate[late], rel=0.03, abs=2e-3)


def test_a_finer_step_changes_little() -> None:
    load = history([NOTHING, (13.0, 0.0, 0.04)], [0.0, 0.5])
    coarse, fine = (simulate(PATCH, DROPS, load, step_s=step) for step in (2.5e-4, 2.5e-5))
    assert onset(coarse) == pytest.approx(onset(fine), abs=2)
    before = slice(0, onset(fine) - 5)
    assert coarse.wrench_left[before, 0] == pytest.approx(fine.wrench_left[before, 0], abs=0.002 * GRIP_N)
    moved = np.abs(fine.displacement[-1]).max(initial=0.0, where=[True, True, False])
    assert coarse.displacement[-1, :2] == pytest.approx(fine.displacement[-1, :2], abs=0.03 * moved)
    assert coarse.displacement[-1, 2] == pytest.approx(fine.displacement[-1, 2], rel=0.03)


def test_a_finer_grid_changes_little() -> None:
    load = ramp((9.0, 0.0, 0.07))
    coarse, fine = (simulate(PATCH, STEADY, load, cell_m=cell) for cell in (0.0015, 0.0005))
    assert coarse.t_s[onset(coarse)] == pytest.approx(fine.t_s[onset(fine)], rel=0.015)


def winkler(s: float) -> float:
    """Load over the limit at a displacement s of that at which the last cell slides: Hertz's disc on bristles."""
    return 1.5 * s - 0.5 * s**3


def test_partial_slip_of_a_round_contact_follows_the_closed_form_and_masings_rule_back() -> None:
    """Cells beyond √(1 − s²) of the radius slide, with a share s³ of the load; a load that falls again from its peak
    follows the curve of loading at twice the scale."""
    friction, stiffness = FrictionLaw(mu_s=0.5, mu_d=0.5), PAD.stiffness_n_per_m3
    radius, peak_s = 0.010, 0.75
    last_m = 0.5 * GRIP_N * 1.5 / (np.pi * radius**2) / stiffness
    peak_n = 2 * 0.5 * GRIP_N * winkler(peak_s)
    load = history([NOTHING, (peak_n, 0.0, 0.0), NOTHING], [0.0, 1.5, 3.0])
    trace = simulate(ContactPatch("disc", radius, None), friction, load, cell_m=0.0005)
    s, ratio = trace.displacement[:, 0] / last_m, trace.wrench_left[:, 0] / (0.5 * GRIP_N)
    up, down = slice(100, 1500, 50), slice(1550, 3000, 50)
    assert ratio[up] == pytest.approx(winkler(s[up]), abs=3e-3)
    assert trace.sliding_share[up] == pytest.approx(s[up] ** 3, abs=0.02)
    assert ratio[down] == pytest.approx(winkler(s[1500]) - 2 * winkler((s[1500] - s[down]) / 2), abs=7e-3)
