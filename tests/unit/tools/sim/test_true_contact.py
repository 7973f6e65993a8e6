import math

import numpy as np
import pytest
from pad_wrenches import finger_load, pad_wrench

from slipd.fusion import contact_from_wrench
from slipd.tools.sim.scene_parts import FrictionLimit, Pad, Patch
from slipd.tools.sim.stickslip import FrictionLaw, GraspedObject, LoadHistory, PadCompliance, simulate

MU = 0.6


def disc(radius_m: float) -> Patch:
    return Patch(radius_m, radius_m, exponent=2.0, centre_m=(0.0, 0.0))


def test_a_round_hertz_contact_resists_the_spin_of_the_closed_form():
    needed = FrictionLimit(disc(0.01), cell_m=0.001).need_n((0.0, 0.0, 0.02), MU)
    assert needed == pytest.approx(0.02 / (3 * math.pi / 16 * MU * 0.01), rel=0.005)


def test_a_pure_pull_needs_its_size_over_mu_whatever_the_patch():
    assert FrictionLimit(Patch()).need_n((3.0, -4.0, 0.0), MU) == pytest.approx(5.0 / MU, rel=1e-6)


def test_no_load_needs_no_grip():
    assert FrictionLimit(Patch()).need_n((0.0, 0.0, 0.0), MU) == 0.0


def test_a_coarse_grid_gives_the_limit_of_a_fine_one():
    load = (1.5, 0.3, 0.03)
    coarse, fine = (FrictionLimit(Patch(), cell_m).need_n(load, MU) for cell_m in (0.002, 0.0005))
    assert coarse == pytest.approx(fine, rel=0.005)


def test_the_radius_of_gyration_is_that_of_the_closed_form():
    assert FrictionLimit(disc(0.01), cell_m=0.0005).gyration_m == pytest.approx(0.01 * math.sqrt(0.4), rel=0.005)


@pytest.mark.parametrize("patch", [Patch(), disc(0.012)])
def test_the_physical_simulator_presses_the_same_patch(patch):
    t = np.array([0.0, 0.001])
    history = LoadHistory(t, np.zeros((2, 2)), np.zeros(2), np.full(2, 6.0))
    trace = simulate(GraspedObject(), patch.for_stick_slip(), FrictionLaw(), PadCompliance(), history)
    assert trace.taxel_loads(Pad(), [0.0])[0] == pytest.approx(6.0 * Pad().shares(patch), rel=0.02, abs=1e-3)


def test_a_patch_that_the_physical_simulator_does_not_know_is_refused():
    with pytest.raises(ValueError, match="exponent must be 2 or 4"):
        Patch(exponent=3.0).for_stick_slip()


def test_the_cells_balance_about_the_patch_centre():
    x, y, shares = Patch(centre_m=(0.003, -0.002)).cells(0.001)
    assert shares.sum() == pytest.approx(1.0)
    assert (x @ shares, y @ shares) == pytest.approx((0.003, -0.002), abs=1e-12)


def test_taxels_are_counted_along_the_longer_side_first():
    x, y = Pad().centres()
    assert x.shape == y.shape == (128,)
    assert x[1] - x[0] == pytest.approx(0.0032)
    assert y[1] == y[0]
    assert y[16] - y[0] == pytest.approx(0.0032)
    assert (x.sum(), y.sum()) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_the_image_carries_the_force_and_its_centroid():
    shares = Pad().shares(Patch())
    x, y = Pad().centres()
    assert shares.sum() == pytest.approx(1.0, abs=0.02)
    assert (x @ shares, y @ shares) / shares.sum() == pytest.approx(Patch().centre_m, abs=2e-4)
    assert shares.min() == 0.0


def test_an_electrode_over_the_rim_feels_a_part_of_its_neighbours_pressure():
    pad = Pad(rows=1, cols=2, pitch_m=0.010, electrode_m=0.004)
    shares = pad.shares(disc(0.0055))
    alone = Pad(rows=1, cols=2, pitch_m=0.010, electrode_m=1e-6).shares(disc(0.0055))
    assert 0.0 < shares[0] < alone[0]


def test_the_right_pad_sees_the_mirror_image():
    image = Pad().shares(Patch()).reshape(8, 16)
    assert Pad().shares(Patch().mirrored()).reshape(8, 16) == pytest.approx(image[::-1])


def test_both_fingers_together_carry_the_load_in_the_gripper_frame():
    load = (2.0, 3.0, 0.05)
    # Rows are the pad's axes in the gripper frame: Z approach, Y from the right finger to the left.
    left = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    right = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    force, torque = np.zeros(3), np.zeros(3)
    for axes, is_right in ((left, False), (right, True)):
        assert np.linalg.det(axes) == pytest.approx(1.0)
        fx, fy, spin = finger_load(load, right=is_right)
        patch = Patch().mirrored() if is_right else Patch()
        f, m = pad_wrench((fx, fy, spin), 10.0, patch.centre_m)
        force += axes.T @ f
        centre = axes.T @ np.array([*patch.centre_m, 0.0])
        torque += axes.T @ m - np.cross(centre, axes.T @ f)  # about the contact's centre, both pads' planes merged
    assert force == pytest.approx(left.T @ np.array([2.0, 3.0, 0.0]))
    assert torque == pytest.approx(left.T @ np.array([0.0, 0.0, 0.05]))


def test_the_contact_equations_find_the_load_in_the_wrench():
    contact = contact_from_wrench(*pad_wrench((1.0, -2.0, 0.03), 8.0, (0.004, -0.002)))
    assert contact.normal_n == pytest.approx(8.0)
    assert contact.centroid_m == pytest.approx((0.004, -0.002))
    assert contact.tangential_n == pytest.approx((1.0, -2.0))
    assert contact.spin_nm == pytest.approx(0.03)
