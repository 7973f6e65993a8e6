import math

import numpy as np
import pytest
from pad_wrenches import finger_load, pad_wrench

from slipd.tools.sim.scene_parts import FrictionLimit, Pad, Patch

MU = 0.6


def disc(radius_m: float) -> Patch:
    return Patch(radius_m, radius_m, exponent=2.0, centre_m=(0.0, 0.0))


def test_a_round_hertz_contact_resists_the_spin_of_the_closed_form():
    needed = FrictionLimit(disc(0.01), cell_m=0.001).need_n((0.0, 0.0, 0.02), MU)
    assert needed == pytest.approx(0.02 / (3 * math.pi / 16 * MU * 0.01), rel=0.005)


def test_a_pure_pull_needs_its_size_over_mu_whatever_the_patch():
    assert FrictionLimit(Patch()).need_n((3.0, -4.0, 0.0), MU) == pytest.approx(5.0 / MU, rel=1e-6)


def test_the_image_carries_the_force_and_its_centroid():
    shares = Pad().shares(Patch())
    x, y = Pad().centres()
    assert shares.sum() == pytest.approx(1.0, abs=0.02)
    assert (x @ shares, y @ shares) / shares.sum() == pytest.approx(Patch().centre_m, abs=2e-4)
    assert shares.min() == 0.0


def test_both_fingers_together_carry_the_load_in_the_gripper_frame():
    # Rows are the pad's axes in the gripper frame: Z approach, Y from the right finger to the left.
    left = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    right = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    wrench = np.zeros((2, 3))
    for axes, is_right in ((left, False), (right, True)):
        centre = (Patch().mirrored() if is_right else Patch()).centre_m
        force, torque = pad_wrench(finger_load((2.0, 3.0, 0.05), right=is_right), 10.0, centre)
        about = torque - np.cross((*centre, 0.0), force)  # about the contact's centre, both pads' planes merged
        wrench += np.stack((force, about)) @ axes
    assert wrench == pytest.approx(np.array(((2.0, 3.0, 0.0), (0.0, 0.0, 0.05))) @ left)
