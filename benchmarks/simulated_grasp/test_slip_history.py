"""What happens before, during and after a slip."""

from __future__ import annotations

import numpy as np
import pytest
from simulated_grasp.contact_patch import ContactPatch
from simulated_grasp.grasp_parts import FrictionLaw, GraspedObject
from simulated_grasp.short_loads import GRIP_N, PAD, history, kinetic_j, onset, simulate

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
    assert np.diff(trace.velocity[-40:, 0]) / np.diff(trace.t_s[-40:]) == pytest.approx(9.81, rel=1e-9)
    assert trace.pressure(-1).loads_n.sum() == 0.0


def winkler(s: float) -> float:
    """Load over the limit at a displacement s of that at which the last cell slides: Hertz's disc on bristles."""
    return 1.5 * s - 0.5 * s**3


def test_partial_slip_of_a_round_contact_follows_the_closed_form_and_masings_rule_back() -> None:
    """Cells beyond √(1 − s²) of the radius slide, with a share s³ of the load; a load that falls again from its peak
    follows the curve of loading at twice the scale."""
    friction, stiffness = FrictionLaw(mu_s=0.5, mu_d=0.5), PAD.stiffness_n_per_m3
    radius, peak_s = 0.010, 0.75
    last_m = 0.5 * GRIP_N * 1.5 / (np.pi * radius**2) / stiffness
    load = history([NOTHING, (2 * 0.5 * GRIP_N * winkler(peak_s), 0.0, 0.0), NOTHING], [0.0, 1.5, 3.0])
    trace = simulate(ContactPatch("disc", radius, None), friction, load, cell_m=0.0005)
    s, ratio = trace.displacement[:, 0] / last_m, trace.wrench_left[:, 0] / (0.5 * GRIP_N)
    up, down = slice(100, 1500, 50), slice(1550, 3000, 50)
    assert ratio[up] == pytest.approx(winkler(s[up]), abs=3e-3)
    assert trace.sliding_share[up] == pytest.approx(s[up] ** 3, abs=0.02)
    assert ratio[down] == pytest.approx(winkler(s[1500]) - 2 * winkler((s[1500] - s[down]) / 2), abs=7e-3)
