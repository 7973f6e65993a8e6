"""Scenes of the second world: their draws, their truth, and the faults of their sensors."""

from __future__ import annotations

import numpy as np
import pytest
from evaluate.families import FAMILIES
from evaluate.finger_sensing import PadSensing
from evaluate.running import Task, Variant, run_task
from second_world.rubber_scene import CREEP_RATIO, RATIO, Faults, draw
from second_world.rubber_trace import felt, play, readings, truth_of


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_has_a_scene_of_other_friction(family: str) -> None:
    scene, again = draw(family, 1), draw(family, 1)
    assert np.array_equal(scene.load, again.load)
    assert scene.rubber == again.rubber
    ratio = scene.friction.mu_d / scene.friction.mu_s
    assert RATIO[0] <= ratio <= RATIO[1] or CREEP_RATIO[0] <= ratio <= CREEP_RATIO[1]


def test_a_held_object_uses_the_friction_that_was_drawn_and_a_heavy_one_falls() -> None:
    scene = draw("hold", 1)
    trace = play(scene)
    truth = truth_of(scene, trace)
    assert truth.episodes() == []
    assert 0.2 < truth.utilisation[-1] < 0.75
    assert np.abs(trace.slid[-1]).max() < 1e-3
    falling = draw("pour", 0)
    fallen = play(falling)
    (slip,) = truth_of(falling, fallen).episodes()
    assert slip.end_s == pytest.approx(fallen.t_s[-1], abs=1e-3)
    assert np.hypot(*fallen.slid[-1, :2]) == pytest.approx(0.04, rel=0.05)


@pytest.mark.parametrize("seed", range(2))
def test_a_swung_box_turns_and_springs_back_without_a_slip(seed: int) -> None:
    scene = draw("swing", seed)
    trace = play(scene)
    assert truth_of(scene, trace).episodes() == []
    turned = np.degrees(trace.displacement[:, 2])
    assert 0.7 < np.abs(turned).max() < 6.0
    assert abs(turned[-1]) < 0.4 * np.abs(turned).max()


def test_a_force_sensor_rings_couples_and_rounds() -> None:
    wrench = np.zeros((400, 6))
    wrench[100:, 2] = -10.0
    faults = Faults(ring_hz=100.0, coupling=(0.01, 0.0), step_n=0.01, wander_n=0.0)
    seen = felt(wrench, faults, np.random.default_rng(0))
    assert seen[:, 2].min() < -12.0
    assert seen[-1, 2] == pytest.approx(-10.0, abs=0.1)
    assert seen[-1, 0] == pytest.approx(-0.1, abs=0.02)
    assert np.allclose(seen[:, :3] / 0.01, np.rint(seen[:, :3] / 0.01))


def test_taxels_leak_to_their_neighbours_lag_and_creep() -> None:
    pad = PadSensing()
    x, y = pad.positions()
    place = np.array(((x[40],), (y[40],)))
    up_and_down = [(place, np.array((load,))) for load in (*np.linspace(0.0, 1.0, 20), *np.linspace(1.0, 0.0, 20))]
    seen = readings(up_and_down, pad, Faults(play=0.1, play_n=0.1, creep=0.0), right=False)
    assert seen[19].argmax() == 40
    assert seen[19, 41] > 0.02 * seen[19, 40]
    assert seen[29, 40] > seen[10, 40], "it lags"
    assert seen[-1, 40] > 0.0
    held = readings(up_and_down[:20] + [up_and_down[19]] * 400, pad, Faults(creep=0.1), right=False)
    assert held[-1, 40] > 1.03 * held[20, 40]


def test_the_engine_runs_in_the_second_world() -> None:
    (result,) = run_task(Task("grip closes", 0, (Variant(),), "second"))
    assert result.world == "second"
    assert result.score.episodes == []
