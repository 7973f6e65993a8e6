"""Mass and centre of mass are identified from sufficient poses; insufficient poses are refused."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from slipd.signals.gravity import STANDARD_GRAVITY_MPS2, FingerWeight
from slipd.tools.commission.weight_identification import Identification, identify

G = STANDARD_GRAVITY_MPS2
COM = (0.002, -0.001, -0.012)
WEIGHT = FingerWeight(0.060, COM)
BIAS = np.array((1.5, -2.0, 30.0, 0.1, -0.2, 0.05))
POSES = G * np.array(((0, 0, -1), (1, 0, 0), (0, 1, 0), (0, -1, 0), (-1, 0, 0), (0, 0, 1)), dtype=float)


def found_in(gravities: np.ndarray, weight: FingerWeight = WEIGHT, noise: np.ndarray | float = 0.0) -> Identification:
    wrenches = np.array([weight.wrench(gravity) for gravity in gravities]).reshape(-1, 6) + BIAS + noise
    return identify(wrenches[:, :3], wrenches[:, 3:], gravities)


@given(
    quats=arrays(np.float64, (3, 4), elements=st.floats(-0.1, 0.1)),
    mass=st.floats(0.005, 5.0),
    com=arrays(np.float64, 3, elements=st.floats(-0.2, 0.2)),
)
def test_without_noise_everything_is_found_exactly(quats: np.ndarray, mass: float, com: np.ndarray) -> None:
    quats[:, 3] = 1.0  # each pose turned a little from its own place
    gravities = np.array([Rotation.from_quat(q).apply(g) for q, g in zip(quats, POSES[:3], strict=True)])
    found = found_in(gravities, FingerWeight(mass, tuple(com)))
    assert found.mass_kg == pytest.approx(mass, rel=1e-9)
    assert_allclose(found.com_m, com, atol=1e-8)
    assert_allclose(found.bias_force_n, BIAS[:3], atol=1e-8)
    assert_allclose(found.bias_torque_nm, BIAS[3:], atol=1e-8)
    assert found.residual_n < 1e-8
    assert found.residual_nm < 1e-8
    assert found.poses == 3


def test_standard_errors_and_residuals_tell_the_truth() -> None:
    """Over many trials, the spread of the results is what each of them says of itself."""
    rng = np.random.default_rng(1)
    sigma = np.repeat((0.01, 0.0002), 3)
    gravities = np.array([Rotation.random(random_state=k).apply(POSES[0]) for k in range(8)])
    trials = [found_in(gravities, noise=rng.normal(scale=sigma, size=(8, 6))) for _ in range(400)]
    masses = np.array([trial.mass_kg for trial in trials])
    coms = np.array([trial.com_m for trial in trials])
    assert masses.mean() == pytest.approx(0.060, abs=5e-5)
    assert_allclose(coms.mean(axis=0), COM, atol=1e-4)
    assert math.sqrt(np.mean([trial.mass_std_kg**2 for trial in trials])) == pytest.approx(masses.std(), rel=0.1)
    assert_allclose(np.sqrt(np.mean([trial.com_std_m**2 for trial in trials], axis=0)), coms.std(axis=0), rtol=0.1)
    assert math.sqrt(np.mean([trial.residual_n**2 for trial in trials])) == pytest.approx(0.01, rel=0.03)
    assert math.sqrt(np.mean([trial.residual_nm**2 for trial in trials])) == pytest.approx(0.0002, rel=0.03)


FEW = "at least 3 poses with gravity in different directions, got "
ALIKE = POSES[[0, 0, 0, 0]] + 0.1 * np.eye(4, 3)
LOST = np.random.default_rng(2).normal(scale=0.02, size=(6, 6))
UPWARDS = -2.0 * np.array([WEIGHT.wrench(gravity) for gravity in POSES])


@pytest.mark.parametrize(
    ("gravities", "weight", "noise", "words"),
    [
        *((POSES[:count], WEIGHT, 0.0, f"{FEW}{count}") for count in (0, 1, 2)),
        (ALIKE, WEIGHT, 0.0, r"gravity is about \(0\.0\d, 0\.0\d, -9\.7\d\) m/s² in every pose; add poses"),
        (POSES, FingerWeight(0.0005, COM), LOST, r"mass must differ clearly from zero, got .*: leave mass_kg out"),
        (POSES, FingerWeight(), -BIAS, "mass must differ clearly from zero"),
        (POSES, WEIGHT, UPWARDS, "sign or pad_from_sensor is wrong, or gravity points the other way"),
    ],
)
def test_too_few_poses_and_a_mass_that_is_lost_in_the_noise_or_falls_up_are_refused_with_what_helps(
    gravities: np.ndarray, weight: FingerWeight, noise: np.ndarray, words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        found_in(gravities, weight, noise)


@pytest.mark.parametrize("axis", range(3))
def test_N3_poses_on_one_line_leave_the_centre_along_it_unseen_and_it_is_named(axis: int) -> None:
    line = np.zeros((4, 3))
    line[:, axis] = (-9.8, -3.0, 4.0, 9.8)
    with pytest.raises(ValueError, match=r"gravity changes along .* of the pad frame only") as refused:
        found_in(line)
    blind = re.search(r"along \((.*?)\)", str(refused.value))
    assert [abs(float(value)) for value in blind[1].split(",")] == [float(k == axis) for k in range(3)]


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_N1_what_is_no_number_is_refused(place: int, bad: float) -> None:
    tables = [POSES.copy(), POSES.copy(), POSES.copy()]
    tables[place][1, 2] = bad
    with pytest.raises(ValueError, match="must be finite"):
        identify(*tables)
