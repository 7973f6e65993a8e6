"""Wrenches are transformed from the sensor frame to the pad frame, for every mounting."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from slipd.signals.mounting import Mounting

SMALL = st.floats(-10.0, 10.0, allow_subnormal=False)
VECTOR = arrays(np.float64, 3, elements=SMALL)
TURN = arrays(np.float64, 4, elements=st.floats(-1.0, 1.0)).filter(lambda q: np.linalg.norm(q) > 1e-3)


def to_pad(mounting: Mounting, force: np.ndarray, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    wrench = mounting.matrix @ np.concatenate((force, torque))
    return wrench[:3], wrench[3:]


def test_a_sensor_in_the_pad_itself_changes_nothing() -> None:
    force, torque = np.array((1.0, 2.0, -3.0)), np.array((0.1, 0.2, 0.3))
    on_pad = to_pad(Mounting(), force, torque)
    assert_allclose(on_pad[0], force)
    assert_allclose(on_pad[1], torque)


def test_the_torque_is_taken_about_the_pad_and_not_about_the_sensor() -> None:
    """M_pad = M_sensor − r × F with r from the sensor's origin to the pad's: 25 mm in front of the sensor."""
    force, torque = np.array((4.0, 0.0, 0.0)), np.array((0.0, 0.1, 0.0))
    moved = to_pad(Mounting(xyz_m=(0.0, 0.0, -0.025)), force, torque)
    assert_allclose(moved[0], force)
    assert_allclose(moved[1], torque - np.cross((0.0, 0.0, 0.025), force))
    assert_allclose(moved[1], (0.0, 0.0, 0.0), atol=1e-15)


def test_a_force_at_the_pads_origin_has_no_torque_there() -> None:
    pad_from_sensor = np.array((0.004, -0.002, -0.025))
    force = np.array((1.0, -2.0, 3.0))
    felt = np.cross(-pad_from_sensor, force)  # what the sensor feels of it, at its own origin
    assert_allclose(to_pad(Mounting(xyz_m=pad_from_sensor), force, felt)[1], np.zeros(3), atol=1e-15)


def test_a_quarter_turn_about_z_takes_the_sensors_x_to_the_pads_y() -> None:
    half = math.sqrt(0.5)
    mounting = Mounting(quat_xyzw=(0.0, 0.0, half, half))
    force, torque = to_pad(mounting, np.array((1.0, 0.0, 5.0)), np.array((0.0, 1.0, 0.0)))
    assert_allclose(force, (0.0, 1.0, 5.0), atol=1e-15)
    assert_allclose(torque, (-1.0, 0.0, 0.0), atol=1e-15)


def test_a_sensor_that_reports_the_load_by_the_finger_is_turned_round() -> None:
    force, torque = np.array((1.0, 2.0, 3.0)), np.array((0.1, 0.2, 0.3))
    place = {"xyz_m": (0.01, 0.02, 0.03), "quat_xyzw": (0.5, 0.5, 0.5, 0.5)}
    plus, minus = Mounting(sign=1, **place), Mounting(sign=-1, **place)
    for on, by in zip(to_pad(plus, force, torque), to_pad(minus, force, torque), strict=True):
        assert_allclose(by, -on)


@given(xyz=VECTOR, quat=TURN, sign=st.sampled_from((1, -1)), force=VECTOR, torque=VECTOR)
def test_every_mounting_is_the_rigid_body_transform_of_scipy(
    xyz: np.ndarray, quat: np.ndarray, sign: int, force: np.ndarray, torque: np.ndarray
) -> None:
    rotation = Rotation.from_quat(quat)
    turned = rotation.apply(sign * force)
    f, m = to_pad(Mounting(xyz, quat, sign), force, torque)
    assert_allclose(f, turned, atol=1e-12)
    assert_allclose(m, rotation.apply(sign * torque) + np.cross(xyz, turned), atol=1e-11)


@given(quat=TURN, xyz=VECTOR, force=VECTOR, torque=VECTOR)
def test_a_power_does_not_depend_on_where_it_is_measured(
    quat: np.ndarray, xyz: np.ndarray, force: np.ndarray, torque: np.ndarray
) -> None:
    """F·M and |F| are invariants of a wrench, whatever frame it is told in."""
    f, m = to_pad(Mounting(xyz, quat), force, torque)
    assert f @ m == pytest.approx(force @ torque, abs=1e-8)
    assert np.linalg.norm(f) == pytest.approx(np.linalg.norm(force), abs=1e-9)


@given(quat=TURN, xyz=VECTOR, wrench=arrays(np.float64, 6, elements=SMALL), twist=arrays(np.float64, 6, elements=SMALL))
def test_the_power_of_a_wrench_on_a_motion_is_the_same_in_either_frame(
    quat: np.ndarray, xyz: np.ndarray, wrench: np.ndarray, twist: np.ndarray
) -> None:
    """The matrix is the inverse transpose of the adjoint that moves twists (velocity at the origin, rate of turn)."""
    rotation = Rotation.from_quat(quat)
    rate = rotation.apply(twist[3:])
    velocity = rotation.apply(twist[:3]) + np.cross(xyz, rate)
    on_pad = Mounting(xyz, quat).matrix @ wrench
    assert on_pad @ np.concatenate((velocity, rate)) == pytest.approx(wrench @ twist, abs=1e-7)


@given(a=TURN, b=TURN, at=VECTOR, further=VECTOR, signs=st.tuples(*[st.sampled_from((1, -1))] * 2))
def test_one_mounting_on_another_is_the_mounting_of_both(
    a: np.ndarray, b: np.ndarray, at: np.ndarray, further: np.ndarray, signs: tuple[int, int]
) -> None:
    outer, inner = Rotation.from_quat(a), Rotation.from_quat(b)
    both = Mounting(at + outer.apply(further), (outer * inner).as_quat(), signs[0] * signs[1])
    assert_allclose(Mounting(at, a, signs[0]).matrix @ Mounting(further, b, signs[1]).matrix, both.matrix, atol=1e-9)


def test_the_matrix_cannot_be_changed_from_outside() -> None:
    with pytest.raises(ValueError, match="read-only"):
        Mounting().matrix[0, 0] = 2.0


@pytest.mark.parametrize("length", [1e-300, 5e-324, 1e-160, 1e160, 1e300])
def test_N3_a_quaternion_of_any_length_is_a_direction(length: float) -> None:
    turned = Mounting(quat_xyzw=(0.0, 0.0, length, length)).matrix
    assert_allclose(turned, Mounting(quat_xyzw=(0.0, 0.0, 0.5, 0.5)).matrix, atol=1e-15)


def test_a_quaternion_that_is_no_unit_is_only_a_direction() -> None:
    force, torque = np.array((1.0, 2.0, 3.0)), np.zeros(3)
    a = to_pad(Mounting(quat_xyzw=(0.0, 0.0, 3.0, 3.0)), force, torque)[0]
    b = to_pad(Mounting(quat_xyzw=(0.0, 0.0, 1.0, 1.0)), force, torque)[0]
    assert_allclose(a, b, atol=1e-15)


@pytest.mark.parametrize("sign", [0, 2, -2])
def test_a_sign_is_one_or_minus_one(sign: int) -> None:
    with pytest.raises(ValueError, match=r"sign must be \+1 or -1"):
        Mounting(sign=sign)


@pytest.mark.parametrize(
    "place",
    [
        {"quat_xyzw": (0.0, 0.0, 0.0, 0.0)},
        {"quat_xyzw": (0.0, math.nan, 0.0, 1.0)},
        {"xyz_m": (0.0, math.inf, 0.0)},
    ],
)
def test_an_invalid_position_is_refused(place: dict[str, tuple[float, ...]]) -> None:
    with pytest.raises(ValueError, match="finite, and the quaternion not zero"):
        Mounting(**place)
