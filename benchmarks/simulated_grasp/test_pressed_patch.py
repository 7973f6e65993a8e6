"""The pressure: tilt, bounds, an image that moves with the object, and a wet spot."""

from __future__ import annotations

import numpy as np
import pytest
from simulated_grasp.contact_patch import FIELD, ContactPatch, PressedPatch
from simulated_grasp.grasp_parts import FrictionLaw, FrictionMap, GraspedObject, PadCompliance
from simulated_grasp.load_history import LoadHistory
from simulated_grasp.short_loads import GRIP_N, PAD, STEADY, history, onset, ramp, simulate

from slipd.tools.sim.scene_parts import Pad

NOTHING = (0.0, 0.0, 0.0)
PATCH = ContactPatch("rectangle", 0.018, 0.009)


def tilted(load: LoadHistory, tilt_nm: tuple[float, float]) -> LoadHistory:
    return LoadHistory(load.t_s, load.force_n, load.torque_nm, load.grip_n, np.tile(tilt_nm, (len(load.t_s), 1)))


@pytest.mark.parametrize("tilt", [(0.02, 0.0), (0.0, -0.05), (0.03, 0.06), (-0.08, 0.12)])
def test_each_pad_bears_half_of_a_moment_that_tilts_the_object(tilt: tuple[float, float]) -> None:
    trace = simulate(PATCH, STEADY, tilted(ramp(NOTHING, 0.01), tilt))
    mx, my = tilt
    assert trace.wrench_left[-1, 3:5] == pytest.approx((mx / 2, my / 2), abs=1e-7)
    assert trace.wrench_right[-1, 3:5] == pytest.approx((mx / 2, -my / 2), abs=1e-7), "half a turn about x"
    for right in (False, True):
        loads = trace.pressure(-1, right=right).loads_n
        assert loads.sum() == pytest.approx(GRIP_N)
        assert loads.min() >= 0.0


def test_a_patch_that_moves_with_the_object_takes_its_image_along() -> None:
    patch = ContactPatch("edge", 0.006, 0.009, moves_with_object=True)
    trace = simulate(patch, STEADY, history([NOTHING, (12.0, 0.0, 0.0)], [0.0, 0.9]))
    x, y = Pad().positions()
    i = int(np.argmax(trace.displacement[:, 0] > 0.0064))
    moved = trace.displacement[i, 0]
    first, last = trace.taxel_loads(Pad(), [0.0, trace.t_s[i]])
    assert last @ x / last.sum() - first @ x / first.sum() == pytest.approx(moved, rel=0.05)
    assert (trace.wrench_left[i, 4] - trace.wrench_left[0, 4]) / GRIP_N == pytest.approx(moved, rel=0.02)
    assert last @ y / last.sum() == pytest.approx(0.0, abs=1e-6)


def test_a_patch_that_slides_off_the_pad_lets_the_object_fall() -> None:
    pad = PadCompliance(half_length_m=0.020, half_width_m=0.012)
    patch = ContactPatch("disc", 0.005, None, centre_m=(0.012, 0.0), moves_with_object=True)
    trace = simulate(patch, STEADY, history([NOTHING, (12.0, 0.0, 0.0)], [0.0, 1.0]), pad=pad)
    assert trace.displacement[-1, 0] > 0.02
    assert trace.wrench_left[-1] == pytest.approx(0.0)


@pytest.mark.parametrize("moves", [False, True])
def test_an_object_that_has_turned_presses_where_its_faces_are(*, moves: bool) -> None:
    angle, x, y = 0.5, 0.003, -0.002
    bar = GraspedObject(half_width_m=0.004)
    patch = PressedPatch(ContactPatch("disc", 0.012, None, moves_with_object=moves), bar, STEADY, PAD, 0.0005, GRIP_N)
    motion, field = np.array((x, y, angle)), np.zeros(FIELD)
    patch.place(motion)
    loads, holds = np.zeros((2, patch.cells.shape[1]))
    patch.press(GRIP_N, (0.0, 0.0), 0, loads, holds, field)
    across = np.cos(angle) * (patch.on_pad[1] - y) - np.sin(angle) * (patch.on_pad[0] - x)
    assert np.abs(across[loads > 0.0]).max() == pytest.approx(0.004, abs=0.0004)
    assert across == pytest.approx(patch.on_object[1], abs=1e-12)
    taxel_x, taxel_y = Pad().positions()
    image = patch.read(Pad(), motion, GRIP_N, field, right=False)
    across = np.cos(angle) * (taxel_y - y) - np.sin(angle) * (taxel_x - x)
    assert np.abs(across[image > 0.0]).max() < 0.004 + Pad().electrode_m
    assert image.sum() == pytest.approx(GRIP_N, rel=0.1)


def test_a_wet_object_slides_at_its_factor() -> None:
    wet = FrictionMap(-0.1, -0.1, 0.2, np.full((2, 2), 0.6))
    trace = simulate(PATCH, FrictionLaw(mu_s=0.5, mu_d=0.5, wet=wet), ramp((8.0, 0.0, 0.0)))
    i = onset(trace)
    assert 8.0 * trace.t_s[i] == pytest.approx(0.6 * 10.0, rel=0.01)
    assert trace.utilisation_at(np.array((i,))) == pytest.approx(1.0, rel=0.01)


def test_a_wet_spot_comes_under_the_pad_with_the_object() -> None:
    """The spot is 40 mm from the patch; where it arrives, friction falls by its factor."""
    law = FrictionLaw(mu_s=0.5, mu_d=0.5, wet=FrictionMap.spot((-0.040, 0.0), 0.022, 0.5))
    trace = simulate(
        ContactPatch("disc", 0.008, None), law, history([NOTHING, *[(10.5, 0.0, 0.0)] * 2], [0.0, 0.3, 0.6])
    )
    moved, ratio = trace.displacement[:, 0], trace.wrench_left[:, 0] / GRIP_N
    dry = trace.gross & (moved < 0.008)
    wet = (moved > 0.034) & (moved < 0.046)
    assert dry.any()
    assert wet.any()
    assert ratio[dry] == pytest.approx(0.5, rel=0.01)
    assert ratio[wet] == pytest.approx(0.25, rel=0.02)


def test_weight_at_the_centre_of_mass_lets_a_box_swing_to_hang_below_the_grip() -> None:
    """The lever of the weight shrinks as the object turns; friction stops it near the bottom, where it still rocks."""
    box = GraspedObject(mass_kg=0.3, inertia_kgm2=5e-4, centre_of_mass_m=(0.0, 0.06))
    patch, weight = ContactPatch("disc", 0.006, None), 0.3 * 9.81
    t = np.arange(3000) * 0.001
    force = np.stack((weight * np.clip(t / 0.3, 0.0, 1.0), np.zeros(3000)), axis=1)
    load = LoadHistory(t, force, np.zeros(3000), np.full(3000, 15.0), about_m=(0.0, 0.06))
    trace = simulate(patch, FrictionLaw(mu_s=0.5, mu_d=0.4), load, held=box, pad=PAD)
    end = trace.t_s > 2.0
    assert trace.gross.any()
    assert not trace.gross[end].any()
    assert trace.displacement[end, 2] == pytest.approx(-np.pi / 2, abs=0.1)
    assert trace.wrench_left[end, 0] == pytest.approx(weight / 2, rel=0.01)
