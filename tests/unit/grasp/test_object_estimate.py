"""Mass, centre of mass and inertia from the load on both pads, and the motion of the arm at any time, for them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from nanoseconds import MS
from scipy.spatial.transform import Rotation

from slipd.grasp import object_estimate
from slipd.grasp.arm_motion import KEPT_NS, MOST_GAP_NS, MotionHistory
from slipd.grasp.object_estimate import GripperMotion, ObjectEstimate, ObjectState, gripped_again
from slipd.types.samples import ArmSample

NOISE = np.diag((0.03**2,) * 3 + (0.001**2,) * 3)
STILL = np.zeros(3)
COM_M = np.array((0.02, -0.01, 0.03))
DOWN = np.array((0.0, 0.0, 9.81))
NORMAL = np.array((0.0, -1.0, 0.0))


def load_of(gravity: np.ndarray, mass_kg: float = 0.5) -> np.ndarray:
    return mass_kg * np.concatenate((gravity, np.cross(COM_M, gravity)))


def learn(estimate: ObjectEstimate, load: np.ndarray, gravity: np.ndarray, times: int = 1) -> None:
    for _ in range(times):
        estimate.update(load, GripperMotion(gravity, STILL, STILL, 0.0), NOISE, 2.0, 0.04, NORMAL)


def lifted() -> ObjectEstimate:
    """Return the estimate of an object that was lifted and hangs still."""
    estimate = ObjectEstimate()
    for up in (0.0, 1.0, 0.0, -1.0, 0.0):
        learn(estimate, load_of(DOWN * (1.0 + up / 9.81)), DOWN * (1.0 + up / 9.81), 5)
    return estimate


def test_truth_is_within_two_deviations_after_a_lift_and_a_turn() -> None:
    """The errors of each grasp stay: those of the zero, and of the scale of each component."""
    inside, errors_m, n = 0, [], 40
    for rng in np.random.default_rng(31).spawn(n):
        mass_kg, estimate = rng.uniform(0.2, 2.0), ObjectEstimate()
        zero, scale = rng.normal(0.0, 1.0, 6) * np.sqrt(np.diag(NOISE)), rng.normal(1.0, 0.004, 6)
        axis = rng.normal(size=3)
        for part in np.linspace(0.0, 1.0, 30):
            gravity = Rotation.from_rotvec(axis / np.linalg.norm(axis) * 2.0 * part).apply(DOWN)
            noise = rng.normal(0.0, 1.0, 6) * np.sqrt(np.diag(NOISE))
            learn(estimate, scale * load_of(gravity, mass_kg) + zero + noise, gravity)
        found = estimate.state
        assert found.unknown == ""
        off = (np.array(found.com_m) - COM_M) / found.com_std_m
        inside += abs(found.mass_kg - mass_kg) < 2.0 * found.mass_std_kg and np.all(abs(off) < 2.0)
        errors_m.append(np.linalg.norm(np.array(found.com_m) - COM_M))
    assert inside >= 0.9 * n
    assert np.percentile(errors_m, 95) < 0.005


@pytest.mark.parametrize("gyration_m", [0.03, 0.11])
def test_inertia_is_known_after_a_turn_about_the_normal_of_the_pads_and_kept(gyration_m: float) -> None:
    estimate, again, inertia = lifted(), lifted(), 0.5 * gyration_m**2
    for phase in np.arange(0.0, 2.0 * math.pi, 0.02 * math.pi):
        gravity = Rotation.from_rotvec((0.0, 1.0 - math.cos(phase), 0.0)).inv().apply(DOWN)
        turn, turning = np.outer((math.pi * math.sin(phase), math.pi**2 * math.cos(phase)), (0.0, 1.0, 0.0))
        pull = gravity - np.cross(turning, COM_M) - np.cross(turn, np.cross(turn, COM_M))
        load = 0.5 * np.concatenate((pull, np.cross(COM_M, pull))) - inertia * np.concatenate((STILL, turning))
        estimate.update(load, GripperMotion(gravity, turn, turning, 0.0), NOISE, 2.0, 0.04, NORMAL)
    found = estimate.state
    assert found.inertia_kgm2 == pytest.approx(inertia, abs=2.0 * found.inertia_std_kgm2)
    assert found.inertia_std_kgm2 < max(0.5 * 0.03**2, 0.25 * inertia)
    again.recognise(gripped_again(estimate.state, 0.001))
    learn(again, load_of(DOWN), DOWN, 5)
    assert again.state.inertia_kgm2 == found.inertia_kgm2


def test_turn_of_the_gripper_adds_the_pull_and_the_tangential_part_at_the_centre_of_mass() -> None:
    omega, alpha, estimate = np.array((0.0, 3.0, 1.0)), np.array((2.0, 0.0, -4.0)), lifted()
    apparent = DOWN - np.cross(alpha, COM_M) - np.cross(omega, np.cross(omega, COM_M))
    load = 0.5 * np.concatenate((apparent, np.cross(COM_M, DOWN)))
    turn = Rotation.from_rotvec((1.2, 0.0, 0.0)).apply(DOWN)
    learn(estimate, load_of(turn), turn, 20)
    predicted = estimate._rows(GripperMotion(DOWN, omega, alpha, 0.0), 0.0) @ estimate._mean
    assert predicted == pytest.approx(load, abs=0.03)


NO_TORQUE = np.array((1.0, 1.0, 1.0, np.nan, np.nan, np.nan))


@pytest.mark.parametrize(
    ("readings", "mass_kg", "unknown"),
    [
        ([(load_of(DOWN, 0.3), DOWN)] * 20, None, object_estimate.NOT_MOVED),
        ([(load_of(up, 0.001), up) for up in (DOWN, -DOWN) for _ in range(5)], None, object_estimate.LIGHT),
        ([(NO_TORQUE * load_of(up), up) for up in (DOWN, -DOWN) for _ in range(5)], 0.5, object_estimate.NO_WIDTH),
    ],
)
def test_what_is_not_known_of_an_object_is_named(
    readings: list[tuple[np.ndarray, np.ndarray]], mass_kg: float | None, unknown: str
) -> None:
    estimate = ObjectEstimate()
    for load, gravity in readings:
        learn(estimate, load, gravity)
    found = estimate.state
    mass = None if mass_kg is None else pytest.approx(mass_kg, rel=0.05)
    assert (found.mass_kg, found.com_m, found.unknown) == (mass, None, unknown)


def test_centre_of_mass_along_gravity_is_unknown_until_the_gripper_turns_and_what_is_set_down_begins_anew() -> None:
    estimate = lifted()
    found = estimate.state
    assert found.mass_kg == pytest.approx(0.5, abs=2.0 * found.mass_std_kg)
    assert (found.com_m, "along z of the gripper" in found.unknown) == (None, True)
    learn(estimate, load_of(DOWN, 0.1), DOWN, object_estimate.MOST_REJECTED - 1)
    assert estimate.state.mass_kg == pytest.approx(0.5, rel=0.1), "a short touch is only left out"
    learn(estimate, load_of(DOWN, 0.1), DOWN)
    assert estimate.state.unknown == object_estimate.UNEXPLAINED


def test_object_that_is_recognised_may_be_gripped_elsewhere_and_is_forgotten_if_it_was_another() -> None:
    estimate, com_std_m = ObjectEstimate(), (0.001, 0.001, 0.002)
    learn(estimate, load_of(DOWN), DOWN, 10)
    estimate.recognise(gripped_again(ObjectState(0.5, 0.005, (0.01, 0.0, 0.02), com_std_m, ""), 0.01))
    learn(estimate, load_of(DOWN), DOWN)
    x_m, y_m, z_m = estimate.state.com_m
    assert (x_m, y_m, z_m) == pytest.approx((*COM_M[:2], 0.02), abs=0.002), "the load shows it across gravity"
    assert estimate.state.com_std_m[2] == pytest.approx(0.0102, rel=0.05)
    learn(estimate, load_of(DOWN, 0.3), DOWN, object_estimate.MOST_REJECTED)
    learn(estimate, load_of(DOWN, 0.3), DOWN, 10)
    assert estimate.state.unknown == object_estimate.NOT_MOVED


PERIOD_NS = 4 * MS


def filled(turning: tuple[float, ...] | None = None, readings: int = 51) -> MotionHistory:
    """Return a history of γ = (t, 0, 9.81) and ω = (0, 0, 2 t), t in ms, from 1 s on."""
    history = MotionHistory()
    for k in range(readings):
        t_ms = 4.0 * k
        sample = ArmSample(0, None, (t_ms, 0.0, 9.81), (0.0, 0.0, 2.0 * t_ms), turning)
        history.add(sample, 1000 * MS + k * PERIOD_NS)
    return history


@pytest.mark.parametrize(("turning", "expected"), [(None, (0.0, 0.0, 2000.0)), ((1.0, 2.0, 3.0), (1.0, 2.0, 3.0))])
def test_motion_is_interpolated_and_its_turn_differentiated_where_it_is_not_reported(
    turning: tuple[float, ...] | None, expected: tuple[float, ...]
) -> None:
    motion = filled(turning).motion(1101 * MS)
    assert motion.gravity_mps2 == pytest.approx((101.0, 0.0, 9.81))
    assert motion.velocity_radps == pytest.approx((0.0, 0.0, 202.0))
    assert motion.acceleration_radps2 == pytest.approx(expected)
    assert motion.std_mps2 == pytest.approx(4.0), "an error of 4 ms"


def test_motion_is_unknown_outside_and_in_gaps() -> None:
    history = filled()
    assert history.newest_ns == 1200 * MS
    assert (history.at([999 * MS]), history.at([1201 * MS]), history.motion(1190 * MS)) == (None, None, None)
    assert history.at([1200 * MS])[0, :3] == pytest.approx((200.0, 0.0, 9.81))
    history.add(ArmSample(0, None, (0.0, 0.0, 9.81), (0.0, 0.0, 0.0)), 1200 * MS + MOST_GAP_NS + 1)
    assert history.at([1210 * MS]) is None


def test_history_is_short_and_begins_anew_when_time_goes_back() -> None:
    history = filled(readings=200)
    assert history.at([history.newest_ns - KEPT_NS - PERIOD_NS]) is None
    history.add(ArmSample(0, None, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)), 1000 * MS)
    assert history.newest_ns == 1000 * MS
    assert np.all(history.at([1000 * MS])[0, :3] == (1.0, 0.0, 0.0))
    assert MotionHistory().newest_ns == 0
