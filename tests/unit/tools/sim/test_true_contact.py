import math

import pytest

from slipd.tools.sim.scene_parts import FrictionLimit, Pad, Patch

MU = 0.6


def test_a_round_hertz_contact_resists_the_spin_of_the_closed_form():
    disc = Patch(0.01, 0.01, exponent=2.0, centre_m=(0.0, 0.0))
    needed = FrictionLimit(disc, cell_m=0.001).need_n((0.0, 0.0, 0.02), MU)
    assert needed == pytest.approx(0.02 / (3 * math.pi / 16 * MU * 0.01), rel=0.005)


def test_a_pure_pull_needs_its_size_over_mu_whatever_the_patch():
    assert FrictionLimit(Patch()).need_n((3.0, -4.0, 0.0), MU) == pytest.approx(5.0 / MU, rel=1e-6)


def test_the_image_carries_the_force_and_its_centroid():
    shares = Pad().shares(Patch())
    x, y = Pad().positions()
    assert shares.sum() == pytest.approx(1.0, abs=0.02)
    assert (x @ shares, y @ shares) / shares.sum() == pytest.approx(Patch().centre_m, abs=2e-4)
    assert shares.min() == 0.0
