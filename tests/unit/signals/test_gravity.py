"""The finger's own weight is subtracted if the direction of gravity is known, and bounds the error if not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from slipd.signals.gravity import (
    FRESH_NS,
    MOST_GRAVITY_MPS2,
    STANDARD_GRAVITY_MPS2,
    FingerWeight,
    GravityCompensation,
    gravity_at,
    gravity_fault,
)

WEIGHT = FingerWeight(0.060, (0.002, -0.001, -0.012))
DOWN = (0.0, 0.0, -STANDARD_GRAVITY_MPS2)
POSE = arrays(np.float64, 4, elements=st.floats(-1.0, 1.0)).filter(lambda q: np.linalg.norm(q) > 1e-3)


@given(quat=POSE, com=arrays(np.float64, 3, elements=st.floats(-0.1, 0.1)))
def test_a_weight_is_the_sum_of_its_parts_in_every_pose(quat: np.ndarray, com: np.ndarray) -> None:
    gravity = Rotation.from_quat(quat).inv().apply(DOWN)
    parts = com + np.array(((0.01, 0.0, 0.0), (-0.01, 0.02, 0.0), (0.0, -0.02, 0.03), (0.0, 0.0, -0.03)))
    expected = sum(np.concatenate((0.01 * gravity, np.cross(part, 0.01 * gravity))) for part in parts)
    assert_allclose(FingerWeight(0.04, tuple(com)).wrench(gravity), expected, atol=1e-12)


def test_gravity_at_a_place_of_a_turning_body_is_less_its_own_acceleration() -> None:
    """At 0.5 m along X: 2 rad/s about Z pulls outwards by 2 m/s², and speeding up by 3 rad/s² pushes back."""
    assert gravity_at((0.5, 0.0, 0.1), DOWN, (0.0, 0.0, 2.0), None) == pytest.approx((2.0, 0.0, DOWN[2]))
    assert gravity_at((0.5, 0.0, 0.1), DOWN, (0.0, 0.0, 0.0), (0.0, 0.0, 3.0)) == pytest.approx((0.0, -1.5, DOWN[2]))


def test_gravity_is_valid_for_as_long_as_its_source_says_and_compensates_nothing_without_a_weight() -> None:
    weight = GravityCompensation(WEIGHT)
    weight.set(DOWN, 100, 20)
    assert [weight.state(t_ns) for t_ns in (120, 121)] == ["compensated", "unknown_orientation"]
    weight.extend(150)
    weight.extend(130)
    assert [weight.state(t_ns) for t_ns in (150, 151)] == ["compensated", "unknown_orientation"]
    weight.forget()
    weight.extend(200)
    assert weight.state(100) == "unknown_orientation", "what was forgotten stays so"
    none = GravityCompensation(FingerWeight())
    none.set(DOWN, 0)
    assert (none.correction, none.uncertainty(10**12), none.state(10**12)) == (None, (0.0, 0.0), "none")


@given(
    poses=st.tuples(POSE, POSE, POSE),
    tare=st.sampled_from(("config", "known", "unknown")),
    sent=st.booleans(),
    fresh=st.booleans(),
)
def test_what_remains_of_the_weight_is_nothing_where_it_is_known_and_else_within_the_bound(
    poses: tuple[np.ndarray, np.ndarray, np.ndarray], tare: str, sent: bool, fresh: bool
) -> None:
    """A tare takes the weight of its own pose with it; that of the config holds none."""
    at_tare, at_last, at_now = (Rotation.from_quat(quat).inv().apply(DOWN) for quat in poses)
    if tare == "config":
        at_tare = np.zeros(3)
    compensation, t_ns = GravityCompensation(WEIGHT), 1000 + FRESH_NS + (not fresh)
    compensation.retare(None)
    if sent:
        compensation.set(at_last.tolist(), 1000)
    compensation.retare(None if tare == "unknown" else at_tare)
    known = sent and fresh
    assert (compensation.gravity(t_ns) is not None) is known
    if known:
        assert_allclose(compensation.gravity(t_ns), at_last)
        at_now = at_last
    compensated = known and tare != "unknown"
    assert compensation.state(t_ns) == ("compensated" if compensated else "unknown_orientation")
    held = compensation.correction
    assert (held is None) is (tare == "unknown" or not sent), "an old one is held: a step would look like a slip"
    error = WEIGHT.wrench(at_now) - WEIGHT.wrench(at_tare) - (0.0 if held is None else held)
    force_n, torque_nm = compensation.uncertainty(t_ns)
    assert np.linalg.norm(error[:3]) <= force_n * (1 + 1e-9) + 1e-12
    assert np.linalg.norm(error[3:]) <= torque_nm * (1 + 1e-9) + 1e-12
    hidden = STANDARD_GRAVITY_MPS2 if tare == "unknown" or sent else np.linalg.norm(at_tare)
    most_n = 0.0 if compensated else 0.060 * (STANDARD_GRAVITY_MPS2 + hidden)
    assert (force_n, torque_nm) == pytest.approx((most_n, most_n * math.hypot(*WEIGHT.com_m)))


def test_the_correction_cannot_be_changed_from_outside_and_is_never_denormal() -> None:
    compensation = GravityCompensation(WEIGHT)
    compensation.set((5e-324, 1e-310, -9.8), 0)
    correction = compensation.correction
    assert ((correction == 0.0) | (np.abs(correction) > 1e-30)).all(), "N4"
    with pytest.raises(ValueError, match="read-only"):
        correction[0] = 1.0


@pytest.mark.parametrize(
    ("vector", "fault"),
    [
        ([0.0, 0.0, math.nan], "finite, with a length of at most 49.0"),
        ([1e308, 1e308, 0.0], "finite, with a length of at most 49.0"),
        ([40.0, 40.0, 0.0], "finite, with a length of at most 49.0"),
        ([0, 0, -9.8], None),
        ((0.0, 0.0, 0.0), None),
        ([MOST_GRAVITY_MPS2, 0.0, 0.0], None),
    ],
)
def test_N1_N3_a_gravity_is_within_five_g(vector: list[float], fault: str | None) -> None:
    found = gravity_fault(vector)
    assert found is None if fault is None else fault in str(found)
