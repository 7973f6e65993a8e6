"""Wrenches are transformed from the sensor frame to the pad frame, for every mounting."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from slipd.signals.mounting import mounting_matrix

ORIGIN = (0.0, 0.0, 0.0)
SMALL = st.floats(-10.0, 10.0, allow_subnormal=False)
VECTOR = arrays(np.float64, 3, elements=SMALL)
TURN = arrays(np.float64, 4, elements=st.floats(-1.0, 1.0)).filter(lambda q: np.linalg.norm(q) > 1e-3)


@given(xyz=VECTOR, quat=TURN, sign=st.sampled_from((1, -1)), force=VECTOR, torque=VECTOR)
def test_every_mounting_is_the_rigid_body_transform_of_scipy(
    xyz: np.ndarray, quat: np.ndarray, sign: int, force: np.ndarray, torque: np.ndarray
) -> None:
    rotation = Rotation.from_quat(quat)
    turned = rotation.apply(sign * force)
    wrench = mounting_matrix(xyz, quat, sign) @ np.concatenate((force, torque))
    assert_allclose(wrench[:3], turned, atol=1e-12)
    assert_allclose(wrench[3:], rotation.apply(sign * torque) + np.cross(xyz, turned), atol=1e-11)


@pytest.mark.parametrize("length", [3.0, 1e-300, 5e-324, 1e-160, 1e160, 1e300])
def test_N3_a_quaternion_of_any_length_is_a_direction(length: float) -> None:
    turned = mounting_matrix(ORIGIN, (0.0, 0.0, length, length))
    assert_allclose(turned, mounting_matrix(ORIGIN, (0.0, 0.0, 0.5, 0.5)), atol=1e-15)
