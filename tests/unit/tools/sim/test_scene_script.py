import math

import pytest

from slipd.tools.sim.scene_parts import Script


def test_the_weight_comes_on_after_the_lift_and_goes_to_the_table_again():
    script = Script(lift_s=4.0, ramp_s=0.5, set_down_s=15.0)
    assert [script.carried(t) for t in (3.9, 4.25, 4.5, 15.0, 15.25, 15.6)] == pytest.approx([0, 0.5, 1, 1, 0.5, 0])


def test_what_is_poured_in_turns_the_object_by_its_lever():
    fx, fy, spin = Script(pour_s=6.0, pour_n_per_s=0.5, lever_m=0.04).weight(8.0, mass_kg=0.2)
    assert (fx, fy, spin) == pytest.approx((0.2 * 9.81 + 1.0, 0.0, 0.04))


def test_what_was_poured_in_stays_until_it_drains():
    script = Script()
    full = script.weight(script.pour_until_s, 0.25)
    assert script.weight(script.drain_s, 0.25) == full
    assert script.weight(script.drain_s + script.drain_takes_s, 0.25) == script.weight(script.pour_s, 0.25)


def test_the_hand_pulls_by_its_stretch_and_never_pushes():
    script = Script(tug_speed_mps=0.01, tug_stiffness_n_per_m=1000.0, tug_damping_ns_per_m=10.0)
    assert script.tug_n(0.5, 0.001, 0.05) == pytest.approx(1000.0 * 0.004 - 0.5)
    assert script.tug_n(0.1, 0.010, 0.0) == 0.0


def test_phases_follow_each_other_and_a_phase_at_infinity_never_comes():
    script = Script()
    phases = [script.phase(t / 10) for t in range(180)]
    assert list(dict.fromkeys(phases)) == [
        "approach", "lift", "pour", "hold", "drain", "tug", "set_down", "on_table",
    ]  # fmt: skip
    assert Script(tug_s=math.inf).phase(14.0) == "drain"
