"""What the sensors of a finger feel, against their mounting as the config says it and as it really is."""

from dataclasses import replace

import numpy as np
import pytest
from evaluate.finger_sensing import FingerSensing, ForceSensing, PadSensing, offline_config

from slipd import config
from slipd.signals.mounting import mounting_matrix
from slipd.tools.sim.scene_parts import Pad

WRENCH = np.array([[1.0, -2.0, -8.0, 0.01, 0.02, -0.03]])


def in_pad(sensing, felt):
    return (mounting_matrix(sensing.xyz_m, (0.0, 0.0, 0.0, 1.0)) @ felt.T).T


def test_a_sensor_that_is_where_the_config_says_feels_the_wrench():
    sensing = ForceSensing(xyz_m=(0.004, -0.002, -0.025))
    assert in_pad(sensing, sensing.felt(np.zeros(1), WRENCH)) == pytest.approx(WRENCH)


def test_a_sensor_that_is_mounted_a_millimetre_off_moves_the_centroid_by_it():
    sensing = ForceSensing(off_m=(0.001, 0.0, 0.0))
    found = in_pad(sensing, sensing.felt(np.zeros(1), WRENCH))
    force, torque = found[0, :3], found[0, 3:]
    assert force == pytest.approx(WRENCH[0, :3])
    assert torque - WRENCH[0, 3:] == pytest.approx(-np.cross((0.001, 0.0, 0.0), WRENCH[0, :3]))


def test_a_sensor_turned_by_five_degrees_mixes_normal_and_tangential_force():
    sensing = ForceSensing(turn_rad=(np.deg2rad(5.0), 0.0, 0.0))
    force = sensing.felt(np.zeros(1), np.array([[0.0, 0.0, -10.0, 0.0, 0.0, 0.0]]))[0, :3]
    assert force == pytest.approx([0.0, -10.0 * np.sin(np.deg2rad(5.0)), -10.0 * np.cos(np.deg2rad(5.0))])


def test_gain_bias_and_drift_add_up():
    sensing = ForceSensing(gain=1.1, bias=(0.5, *(0.0,) * 5), drift_per_s=(0.0, 0.2, *(0.0,) * 4), xyz_m=(0.0,) * 3)
    found = sensing.felt(np.array([0.0, 3.0]), np.repeat(WRENCH, 2, axis=0))
    assert found[0] == pytest.approx(1.1 * WRENCH[0] + (0.5, *(0.0,) * 5))
    assert found[1] - found[0] == pytest.approx((0.0, 0.6, *(0.0,) * 4))


def test_taxels_are_counted_as_those_of_the_demo():
    assert np.array(PadSensing().positions()) == pytest.approx(np.array(Pad().positions()))


def test_a_pad_can_be_off_turned_and_mirrored():
    x, y = PadSensing().positions()
    assert np.array(PadSensing(off_m=(0.002, -0.001)).positions()) == pytest.approx(np.array([x + 0.002, y - 0.001]))
    assert np.array(PadSensing(mirrored=True).positions()) == pytest.approx(np.array([-x, y]))
    assert np.array(PadSensing(turn_rad=np.pi / 2).positions()) == pytest.approx(np.array([-y, x]))


def test_the_config_knows_nothing_of_the_faults_and_has_no_fault_itself():
    plain = FingerSensing()
    wrong = FingerSensing(
        replace(ForceSensing(), off_m=(0.001, 0.0, 0.0), turn_rad=(0.1, 0.0, 0.0), gain=1.2, bias=(1.0,) * 6),
        PadSensing(off_m=(0.001, 0.0), mirrored=True, turn_rad=0.1),
    )
    assert offline_config({"left": plain}, 0.5) == offline_config({"left": wrong}, 0.5)
    parsed = config.parse(offline_config({"left": plain, "right": plain}, None), "x")
    assert set(parsed.streams()) == {"left.wrench", "left.pad", "right.wrench", "right.pad"}
    assert parsed.finger["left"].mu is None
