"""The finger's own weight is subtracted if the direction of gravity is known, and bounds the error if not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from slipd.signals.gravity import (
    FRESH_NS,
    MOST_GRAVITY_MPS2,
    STANDARD_GRAVITY_MPS2,
    FingerWeight,
    GravityCompensation,
    gravity_fault,
)

WEIGHT = FingerWeight(0.060, (0.002, -0.001, -0.012))
DOWN = (0.0, 0.0, -STANDARD_GRAVITY_MPS2)
ALONG = (STANDARD_GRAVITY_MPS2, 0.0, 0.0)
TURN = arrays(np.float64, 4, elements=st.floats(-1.0, 1.0)).filter(lambda q: np.linalg.norm(q) > 1e-3)


def test_a_weight_pulls_where_gravity_points_with_its_own_lever() -> None:
    """A pad that looks down (Z along gravity): the weight pulls the finger along +Z, as a pull on the pad would."""
    wrench = FingerWeight(0.1, (0.01, 0.0, -0.02)).wrench((0.0, 0.0, 10.0))
    assert_allclose(wrench, (0.0, 0.0, 1.0, 0.0, -0.01, 0.0), atol=1e-15)


def test_a_finger_in_free_fall_weighs_nothing() -> None:
    assert_array_equal(WEIGHT.wrench((0.0, 0.0, 0.0)), np.zeros(6))


@given(quat=TURN, com=arrays(np.float64, 3, elements=st.floats(-0.1, 0.1)))
def test_a_weight_is_the_sum_of_its_parts_in_every_pose(quat: np.ndarray, com: np.ndarray) -> None:
    gravity = Rotation.from_quat(quat).inv().apply(DOWN)
    offsets = np.array(((0.01, 0.0, 0.0), (-0.01, 0.02, 0.0), (0.0, -0.02, 0.03), (0.0, 0.0, -0.03)))
    force, torque = np.zeros(3), np.zeros(3)
    for part in com + offsets:
        pull = 0.01 * gravity
        force += pull
        torque += np.cross(part, pull)
    assert_allclose(FingerWeight(0.04, tuple(com)).wrench(gravity), (*force, *torque), atol=1e-12)


@pytest.mark.parametrize("mass", [-0.1, math.nan, math.inf])
def test_an_invalid_mass_is_refused(mass: float) -> None:
    with pytest.raises(ValueError, match="mass_kg must be finite and at least 0"):
        FingerWeight(mass)


@pytest.mark.parametrize("com", [(0.0, 0.0), (0.0, math.nan, 0.0), (math.inf, 0.0, 0.0)])
def test_an_invalid_centre_is_refused(com: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="com_m must be three finite numbers"):
        FingerWeight(0.1, com)


def test_without_a_weight_there_is_nothing_to_compensate() -> None:
    none = GravityCompensation(FingerWeight())
    none.set(DOWN, 0)
    assert none.correction is None
    assert none.uncertainty(10**12) == (0.0, 0.0)
    assert none.state(10**12) == "none"


def test_the_weight_is_subtracted_once_gravity_is_known() -> None:
    compensation = GravityCompensation(WEIGHT)
    assert compensation.correction is None
    assert compensation.state(0) == "unknown_orientation"
    compensation.set(DOWN, 0)
    assert_allclose(compensation.correction, WEIGHT.wrench(DOWN))
    assert compensation.uncertainty(0) == (0.0, 0.0)
    assert compensation.state(0) == "compensated"
    assert_array_equal(compensation.gravity(0), DOWN)


@given(
    bias=arrays(np.float64, 6, elements=st.floats(-5.0, 5.0)),
    load=arrays(np.float64, 6, elements=st.floats(-5.0, 5.0)),
    taken=TURN,
    now=TURN,
)
def test_a_tare_in_a_known_pose_leaves_the_load_alone_in_every_other(
    bias: np.ndarray, load: np.ndarray, taken: np.ndarray, now: np.ndarray
) -> None:
    compensation = GravityCompensation(WEIGHT)
    at_tare, at_load = (Rotation.from_quat(quat).inv().apply(DOWN) for quat in (taken, now))
    compensation.set(at_tare.tolist(), 0)
    offset = bias + WEIGHT.wrench(at_tare)
    compensation.retare(compensation.gravity(0))
    compensation.set(at_load.tolist(), 0)
    reading = bias + WEIGHT.wrench(at_load) + load
    assert_allclose(reading - offset - compensation.correction, load, atol=1e-12)


@given(taken=TURN, now=TURN, later=TURN)
def test_what_a_tare_in_an_unknown_pose_may_hide_is_within_the_bound(
    taken: np.ndarray, now: np.ndarray, later: np.ndarray
) -> None:
    compensation = GravityCompensation(WEIGHT)
    at_tare, at_load, at_end = (Rotation.from_quat(quat).inv().apply(DOWN) for quat in (taken, now, later))
    compensation.retare(None)
    compensation.set(at_load.tolist(), 0)
    assert compensation.state(0) == "unknown_orientation", "nobody knows what the tare swallowed"
    assert compensation.correction is None
    error = WEIGHT.wrench(at_end) - WEIGHT.wrench(at_tare)
    force_n, torque_nm = compensation.uncertainty(0)
    assert force_n == pytest.approx(2 * 0.060 * STANDARD_GRAVITY_MPS2)
    assert np.linalg.norm(error[:3]) <= force_n * (1 + 1e-12)
    assert np.linalg.norm(error[3:]) <= torque_nm * (1 + 1e-12)


def test_a_tare_under_known_gravity_ends_the_doubt_and_its_undo_brings_it_back() -> None:
    compensation = GravityCompensation(WEIGHT)
    compensation.retare(None)
    compensation.set(DOWN, 0)
    compensation.retare(compensation.gravity(0))
    assert compensation.state(0) == "compensated"
    assert_allclose(compensation.correction, np.zeros(6))
    compensation.retare(None)
    assert compensation.state(0) == "unknown_orientation"


def test_the_offset_of_the_config_hides_no_weight_so_less_is_unknown() -> None:
    force_n, torque_nm = GravityCompensation(WEIGHT).uncertainty(0)
    assert force_n == pytest.approx(0.060 * STANDARD_GRAVITY_MPS2)
    assert torque_nm == pytest.approx(force_n * math.hypot(*WEIGHT.com_m))
    tared = GravityCompensation(WEIGHT)
    tared.retare(np.array((0.0, 0.0, -5.0)))
    assert tared.uncertainty(0)[0] == pytest.approx(0.060 * (STANDARD_GRAVITY_MPS2 + 5.0))


@given(last=TURN, now=TURN)
def test_an_orientation_that_grew_old_is_held_and_no_longer_trusted(last: np.ndarray, now: np.ndarray) -> None:
    compensation = GravityCompensation(WEIGHT)
    at_last, at_now = (Rotation.from_quat(quat).inv().apply(DOWN) for quat in (last, now))
    compensation.set(at_last.tolist(), 1000)
    held = compensation.correction
    assert compensation.state(1000 + FRESH_NS) == "compensated"
    after = 1001 + FRESH_NS
    assert compensation.state(after) == "unknown_orientation"
    assert compensation.gravity(after) is None
    assert compensation.correction is held, "a step by itself would look like a slip"
    error = WEIGHT.wrench(at_now) - held
    force_n, torque_nm = compensation.uncertainty(after)
    assert np.linalg.norm(error[:3]) <= force_n * (1 + 1e-9)
    assert np.linalg.norm(error[3:]) <= torque_nm * (1 + 1e-9)
    compensation.set(ALONG, after)
    assert compensation.state(after) == "compensated"


def test_the_correction_is_made_once_and_cannot_be_changed_from_outside() -> None:
    compensation = GravityCompensation(WEIGHT)
    compensation.set(ALONG, 0)
    assert compensation.correction is compensation.correction
    with pytest.raises(ValueError, match="read-only"):
        compensation.correction[0] = 1.0


@pytest.mark.parametrize(
    ("given_vector", "told"),
    [
        (None, "list of three"),
        ([0.0, 0.0], "list of three"),
        ("abc", "list of three"),
        ([0.0, "1", 0.0], "must hold numbers"),
        ([True, 0.0, 0.0], "must hold numbers"),
        ([0.0, 0.0, math.nan], "finite, with a length of at most 49.0"),
        ([math.inf, 0.0, -math.inf], "finite, with a length of at most 49.0"),
        ([1e308, 1e308, 0.0], "finite, with a length of at most 49.0"),
        ([10**400, 0, 0], "finite, with a length of at most 49.0"),
        ([40.0, 40.0, 0.0], "finite, with a length of at most 49.0"),
    ],
)
def test_N1_N3_a_vector_that_is_no_gravity_is_refused_and_leaves_the_old(given_vector: object, told: str) -> None:
    assert told in (gravity_fault(given_vector) or "")
    compensation = GravityCompensation(WEIGHT)
    compensation.set(DOWN, 0)
    with pytest.raises(ValueError, match=told):
        compensation.set(given_vector, FRESH_NS)
    assert_allclose(compensation.correction, WEIGHT.wrench(DOWN))
    assert compensation.state(FRESH_NS + 1) == "unknown_orientation", "what was refused renews nothing"


@pytest.mark.parametrize("vector", [[0, 0, -9.8], (0.0, 0.0, 0.0), [MOST_GRAVITY_MPS2, 0.0, 0.0]])
def test_a_gravity_within_five_g_is_right(vector: object) -> None:
    assert gravity_fault(vector) is None


def test_N4_a_correction_is_never_denormal() -> None:
    compensation = GravityCompensation(WEIGHT)
    compensation.set((5e-324, 1e-310, -9.8), 0)
    correction = compensation.correction
    assert ((correction == 0.0) | (np.abs(correction) > 1e-30)).all()
