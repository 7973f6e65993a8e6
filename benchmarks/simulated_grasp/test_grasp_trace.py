"""The trace: its wrenches in both pad frames, and its images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pad_wrenches import finger_load, pad_wrench
from simulated_grasp.contact_patch import ContactPatch
from simulated_grasp.grasp_parts import GraspedObject
from simulated_grasp.load_history import LoadHistory
from simulated_grasp.short_loads import GRIP_N, STEADY, history, ramp, simulate

from slipd.fusion import contact_from_wrench
from slipd.tools.sim.scene_parts import Pad
from slipd.types.arrays import Array

PATCH = ContactPatch("rounded", 0.018, 0.009, centre_m=(0.002, -0.001))
LOAD = (1.0, 2.0, 0.01)


@pytest.mark.parametrize("right", [False, True])
def test_the_wrench_of_a_finger_is_that_of_half_the_load_in_its_frame(*, right: bool) -> None:
    trace = simulate(PATCH, STEADY, history([(0.0, 0.0, 0.0), LOAD, LOAD], [0.0, 0.5, 1.0]))
    cx, cy = PATCH.centre_m
    about_patch = (LOAD[0], LOAD[1], LOAD[2] - cx * LOAD[1] + cy * LOAD[0])
    centre = (cx, -cy) if right else (cx, cy)
    force, torque = pad_wrench(finger_load(about_patch, right=right), GRIP_N, centre)
    wrench = (trace.wrench_right if right else trace.wrench_left)[-1]
    assert wrench == pytest.approx(np.concatenate((force, torque)), abs=5e-6), "the load has moved by microns"
    assert contact_from_wrench(wrench[:3], wrench[3:]).centroid_m == pytest.approx(centre, abs=1e-9)


@pytest.mark.parametrize("about", [(0.0, 0.0), (0.03, 0.0), (-0.02, 0.05)])
def test_a_force_at_a_point_of_the_object_turns_it_by_its_lever(about: tuple[float, float]) -> None:
    load = history([(0.0, 0.0, 0.0), (0.8, 0.6, 0.004), (0.8, 0.6, 0.004)], [0.0, 0.5, 1.0])
    held = GraspedObject(centre_of_mass_m=(0.01, -0.02))
    trace = simulate(PATCH, STEADY, replace(load, about_m=about), held=held)
    expected = 0.004 + about[0] * 0.6 - about[1] * 0.8
    assert trace.wrench_left[-1, 5] == pytest.approx(expected / 2, abs=2e-4)
    assert trace.wrench_right[-1, 5] == pytest.approx(-expected / 2, abs=2e-4)


def test_the_image_carries_the_force_and_that_of_the_right_pad_is_mirrored() -> None:
    trace = simulate(PATCH, STEADY, ramp(LOAD, 0.01))
    left, right = (trace.taxel_loads(Pad(), [0.0, 0.005], right=side) for side in (False, True))
    assert left.sum(axis=1) == pytest.approx([GRIP_N] * 2, rel=0.03)
    assert right.reshape(2, 8, 16) == pytest.approx(left.reshape(2, 8, 16)[:, ::-1])


def test_the_patch_grows_with_the_force() -> None:
    patch = ContactPatch("disc", 0.008, None, growth=1 / 3, reference_n=10.0)
    trace = simulate(patch, STEADY, history([(0.0, 0.0, 0.0)] * 2, [0.0, 0.5], [1.25, 10.0]), cell_m=0.0005)
    sizes = []
    for i in (0, -1):
        cells = trace.pressure(i)
        assert cells.loads_n.sum() == pytest.approx(trace.normal_n[i])
        sizes.append(np.sqrt(np.average(cells.x_m**2 + cells.y_m**2, weights=cells.loads_n)))
    assert sizes[0] / sizes[1] == pytest.approx(0.5, rel=0.01)


def test_utilisation_counts_what_both_pads_of_a_tilted_grasp_carry_and_nothing_without_a_contact() -> None:
    load = history([(0.0, 0.0, 0.0), (3.0, 4.0, 0.011)], [0.0, 0.4])
    trace = simulate(PATCH, STEADY, replace(load, tilt_nm=np.tile((0.05, 0.05), (len(load.t_s), 1))))
    assert trace.utilisation_at(np.array((200, 400))) == pytest.approx((0.25, 0.5), rel=0.02)
    let_go = simulate(PATCH, STEADY, history([(0.0, 0.0, 0.0)] * 2, [0.0, 0.01], 0.0))
    assert np.isnan(let_go.utilisation).all()


def test_an_unchanged_pressure_gives_the_same_image_and_a_changed_one_another() -> None:
    load = history([(0.0, 0.0, 0.0)] * 3, [0.0, 0.1, 0.2], [10.0, 10.0, 12.0])
    images = simulate(PATCH, STEADY, load).taxel_loads(Pad(), [0.0, 0.05, 0.15, 0.2])
    assert np.array_equal(images[0], images[1])
    assert images[:, :].sum(axis=1) == pytest.approx(images[0].sum() * np.array((1.0, 1.0, 1.1, 1.2)), rel=1e-9)


TWO = np.zeros(2)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"grip_n": np.zeros(3)}, "grip_n must have shape"),
        ({"force_n": np.full((2, 2), np.inf)}, "force_n must be finite"),
        ({"t_s": TWO}, "t_s must not be empty and must increase"),
        ({"grip_n": np.array((1.0, -1.0))}, "must not be negative"),
    ],
)
def test_a_history_that_makes_no_sense_is_refused(fields: dict[str, Array], words: str) -> None:
    well = {"t_s": np.arange(2.0), "force_n": np.zeros((2, 2)), "torque_nm": TWO, "grip_n": TWO}
    with pytest.raises(ValueError, match=words):
        LoadHistory(**well | fields)


def test_a_coarse_history_is_divided() -> None:
    """A history of 20 ms steps gives what one of 1 ms gives, at its samples."""
    coarse, fine = (
        simulate(PATCH, STEADY, history([(0.0, 0.0, 0.0), (8.0, 0.0, 0.02)], [0.0, 0.4], dt_s=dt))
        for dt in (0.02, 0.001)
    )
    assert coarse.displacement == pytest.approx(fine.displacement[::20], rel=1e-3, abs=1e-9)
