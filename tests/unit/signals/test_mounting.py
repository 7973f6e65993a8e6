"""Wrenches are transformed from the sensor frame to the pad frame, for every mounting."""

from __future__ import annotations

import math
from typing import Any

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


@given(xyz=VECTOR, quat=TURN, sign=st.sampled_from((1, -1)), force=VECTOR, torque=VECTOR)
def test_every_mounting_is_the_rigid_body_transform_of_scipy(
    xyz: np.ndarray, quat: np.ndarray, sign: int, force: np.ndarray, torque: np.ndarray
) -> None:
    rotation = Rotation.from_quat(quat)
    turned = rotation.apply(sign * force)
    f, m = to_pad(Mounting(xyz, quat, sign), force, torque)
    assert_allclose(f, turned, atol=1e-12)
    assert_allclose(m, rotation.apply(sign * torque) + np.cross(xyz, turned), atol=1e-11)


@pytest.mark.parametrize("length", [3.0, 1e-300, 5e-324, 1e-160, 1e160, 1e300])
def test_N3_a_quaternion_of_any_length_is_a_direction(length: float) -> None:
    turned = Mounting(quat_xyzw=(0.0, 0.0, length, length)).matrix
    assert_allclose(turned, Mounting(quat_xyzw=(0.0, 0.0, 0.5, 0.5)).matrix, atol=1e-15)


@pytest.mark.parametrize(
    ("place", "said"),
    [
        *(({"sign": sign}, r"sign must be \+1 or -1") for sign in (0, 2, -2)),
        ({"quat_xyzw": (0.0, 0.0, 0.0, 0.0)}, "finite, and the quaternion not zero"),
        ({"quat_xyzw": (0.0, math.nan, 0.0, 1.0)}, "finite, and the quaternion not zero"),
        ({"xyz_m": (0.0, math.inf, 0.0)}, "finite, and the quaternion not zero"),
    ],
)
def test_an_invalid_mounting_is_refused(place: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Mounting(**place)
