"""The scene of the demo: its script, and what the grasp does of it."""

import math

import pytest

from slipd.tools.sim.scene import GripCommand, Scene
from slipd.tools.sim.scene_parts import Script

CLOSE_S, OPEN_S, END_S, SPEED_MPS = 1.5, 16.0, 18.0, 0.05
NEVER = math.inf


def play(scene, force_n=lambda t: 7.0, until_s=END_S, step_s=0.001):
    """Drive the scene like the demo; return it and the state after each step."""
    seen = []
    for i in range(1, round(until_s / step_s) + 1):
        t = i * step_s
        width = 0.0 if CLOSE_S <= t < OPEN_S else scene.open_width_m
        scene.step(t, GripCommand(width, SPEED_MPS, force_n(t)))
        (fx, fy, _, _, _, about_origin), (cx, cy) = scene.wrench(right=False), scene.patch.centre_m
        carried = (
            2 * fx,
            2 * fy,
            2 * (about_origin - cx * fy + cy * fx),
        )  # by both pads, about the contact centre
        seen.append((t, scene.normal_n, scene.sliding, carried, scene.width_m))
    return scene, seen


def times(scene, event):
    return [truth.t_s for truth in scene.truth if truth.event == event]


def raised(at_s, to_n):
    return lambda t: to_n if t >= at_s else 7.0


@pytest.mark.parametrize(
    ("step_s", "speed_mps"), [(0.0007, 0.0333), (0.001, 0.05), (0.00125, 0.085), (0.0013, 0.15), (0.05, 0.02)]
)
def test_the_fingers_close_at_the_commanded_speed_and_stop_at_the_object(step_s, speed_mps):
    scene = Scene()
    for i in range(1, math.ceil(1.6 / step_s)):
        scene.step(i * step_s, GripCommand(0.0, speed_mps, 7.0))
        assert scene.width_m >= scene.object_width_m
    assert times(scene, "contact") == [pytest.approx(0.025 / speed_mps, abs=step_s + 0.002)]
    assert (scene.width_m, scene.moving) == (scene.object_width_m, False)


def test_a_pulled_object_slips_at_mu_s_and_the_friction_ratio_drops_towards_mu_d():
    scene, seen = play(Scene(Script(pour_s=NEVER, drain_s=NEVER)), raised(3.0, 12.0), until_s=14.8)
    (begin,), (end,) = times(scene, "slide_begins"), times(scene, "slide_ends")
    ratio = {round(t, 3): math.hypot(*load[:2]) / 2 / n for t, n, _, load, _ in seen if n > 0}
    assert max(ratio.values()) == pytest.approx(0.6, rel=0.01)
    assert max(ratio, key=ratio.get) == pytest.approx(begin, abs=0.01)
    assert min(ratio[round(begin + k * 1e-3, 3)] for k in range(10, 200)) == pytest.approx(0.45, rel=0.05)
    assert ratio[round(end + 0.05, 3)] < 0.45
    assert 0.2 < end - begin < 0.4
    assert 0.003 < math.hypot(*scene.displacement_m) < 0.02
    assert abs(scene.angle_rad) < 0.01


def test_without_help_the_box_turns_when_forecast_and_falls():
    scene, seen = play(Scene())
    (begin,) = times(scene, "slide_begins")
    (forecast,) = [truth.values for truth in scene.truth if truth.event == "forecast"]
    assert forecast["rotation_would_begin_s"] == pytest.approx(begin, abs=0.03)  # half a percent of the torque
    assert 9.0 < begin < 10.0
    assert times(scene, "dropped")
    assert scene.angle_rad > 0.9
    assert math.hypot(*scene.displacement_m) < 0.01, "it turns and hardly shifts"
    spin = {round(t, 3): load[2] for t, *_, load, _ in seen}
    assert min(spin[round(begin + k * 1e-3, 3)] for k in range(20, 150)) < 0.85 * spin[round(begin - 0.02, 3)]


def test_a_timely_raise_of_the_grip_saves_the_box_until_the_tug():
    scene, seen = play(Scene(), raised(8.8, 14.0))
    begins, ends = times(scene, "slide_begins"), times(scene, "slide_ends")
    assert len(begins) == len(ends) == 1
    assert 13.0 < begins[0] < ends[0] < 15.0
    assert not times(scene, "dropped")
    assert not any(sliding for t, _, sliding, *_ in seen if t < 13.0)
    assert scene.width_m == scene.open_width_m


def test_opening_in_the_air_drops_the_box():
    scene, _ = play(Scene(), until_s=5.0)
    for i in range(1, 500):
        scene.step(5.0 + i * 0.001, GripCommand(scene.open_width_m, SPEED_MPS, 7.0))
    assert times(scene, "dropped")
    assert scene.normal_n == 0.0
    assert not scene.wrench(right=False).any()


def test_a_gripper_that_closes_too_late_leaves_the_box_behind():
    scene = Scene()
    scene.step(5.0, GripCommand(scene.open_width_m, SPEED_MPS, 7.0))
    scene.step(8.0, GripCommand(0.0, SPEED_MPS, 7.0))
    assert [truth.event for truth in scene.truth] == ["left_behind", "pour"]
    assert (scene.width_m, scene.in_contact, scene.utilisation) == (0.0, False, 0.0)


@pytest.mark.parametrize(
    ("t_s", "load"),
    [
        (3.9, (0.0, 0.0, 0.0)),
        (4.25, (0.981, 0.0, 0.0)),
        (6.0, (1.962, 0.0, 0.0)),
        (8.0, (2.962, 0.0, 0.04)),
        (10.0, (3.962, 0.0, 0.08)),
        (11.5, (3.962, 0.0, 0.08)),
        (12.5, (1.962, 0.0, 0.0)),
        (15.25, (0.981, 0.0, 0.0)),
        (15.6, (0.0, 0.0, 0.0)),
    ],
)
def test_the_weight_comes_on_after_the_lift_grows_and_drains_with_its_lever_and_goes_to_the_table(t_s, load):
    assert Script(pour_n_per_s=0.5, lever_m=0.04).weight(t_s, mass_kg=0.2) == pytest.approx(load)


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
