"""From sensor readings to the wrench on the pad: tare, mounting, weight of the finger, drift, in that order."""

from __future__ import annotations

import numpy as np
import pytest
from finger_bench import FULL, make_finger, read_force
from fixture_types import Image, Parse, Wrench
from nanoseconds import MS, T0

from slipd.finger.finger import Finger
from slipd.finger.force_channel import ForceChannel
from slipd.finger.freshness import Read
from slipd.fusion.contact_state import CONTACT_STATE
from slipd.fusion.recent_forces import mean_wrench
from slipd.fusion.rows import new_rows
from slipd.fusion.streaming import move_to_pad, wrench_at
from slipd.publish.stream_health import force_conditions
from slipd.types.samples import WrenchSample
from slipd_client.messages import Health


def test_mounting_moves_wrench_from_sensor_to_pad(left: str, parse: Parse, image: Image) -> None:
    pose = "{ xyz_m = [0.0, 0.0, -0.02], quat_xyzw = [1.0, 0.0, 0.0, 0.0] }"
    turned = left.replace("force_std_n = 0.0", f"force_std_n = 0.0\nsign = -1\npad_from_sensor = {pose}")
    finger = make_finger(turned, parse)
    finger.update_image(image(T0, FULL))
    # Half a turn about X, and the load by the finger: the pad's (2, 0, −10) is the sensor's (−2, 0, −10).
    state = read_force(finger, WrenchSample(T0, None, np.array((-2.0, 0.0, -10.0)), np.zeros(3)))
    assert state.wrench[:3] == pytest.approx((2.0, 0.0, -10.0))
    assert state.wrench[3:] == pytest.approx((0.0, -0.04, 0.0)), "r × F with r 20 mm behind the pad"


G = 9.80665

DOWN, ALONG = [0.0, 0.0, -G], [G, 0.0, 0.0]

HEAVY = 'port = "/dev/left-wrench"\nmass_kg = 0.1\ncom_m = [0.0, 0.0, -0.02]'


@pytest.fixture
def heavy(left: str, parse: Parse) -> str:
    return left.replace('port = "/dev/left-wrench"', HEAVY)


def side(text: str, parse: Parse) -> ForceChannel:
    wrench = parse(text).finger["left"].wrench
    force = ForceChannel(wrench, new_rows(CONTACT_STATE, 1))
    force.tare.observe(T0)
    return force


def read(
    force: ForceChannel, values: object, t_ns: int = T0, *, untouched: bool | None = None, status: tuple[str, ...] = ()
) -> tuple[float, ...]:
    six = np.array(values, dtype=np.float64)
    taken = force.condition([WrenchSample(t_ns, None, six[:3], six[3:], status)], [t_ns], lambda: untouched)
    if not taken.moved:
        move_to_pad(taken.rows, force._state)
    return wrench_at(taken.rows, 0)


def weigh(gravity: list[float]) -> list[float]:
    """What 0.1 kg, 20 mm below the pad, adds to an untared reading."""
    force = 0.1 * np.array(gravity)
    return [*force, *np.cross((0.0, 0.0, -0.02), force)]


def test_finger_weight_is_subtracted_at_every_pose_and_no_part_of_a_tare(heavy: str, parse: Parse) -> None:
    force = side(heavy, parse)
    for bias in (0.0, 0.5, 0.0):
        if bias:
            force.begin_tare(T0, 0.01, "ann")
            for k in range(12):
                read(force, np.add(weigh(ALONG), bias), T0 + k * MS)
            assert force.tare.current.id == 1
        for gravity in (DOWN, ALONG):
            force.set_gravity(gravity, T0)
            assert read(force, np.add(weigh(gravity), bias)) == pytest.approx([0.0] * 6, abs=1e-12)
        assert force.gravity.state(T0) == "compensated"
        assert (force.uncertainty(T0), force_conditions(force, T0)) == ((0.0, 0.0, 0.0, 0.0), [])
        assert force.tare.undo() is (bias > 0.0)


def test_unknown_orientation_adds_uncertainty_and_is_reported(heavy: str, parse: Parse) -> None:
    force = side(heavy, parse)
    assert force.uncertainty(T0)[2] == pytest.approx(0.1 * G)
    ((level, message),) = force_conditions(force, T0)
    assert level == Health.WARN
    assert "no fresh gravity: the finger's weight may add 0.98 N" in message
    force.begin_tare(T0, 0.01, "ann")
    for k in range(12):
        read(force, weigh(DOWN), T0 + k * MS)
    assert force.uncertainty(T0)[2] == pytest.approx(2 * 0.1 * G)
    assert any("tare it once more while gravity is known" in text for _, text in force_conditions(force, T0))


def test_tare_is_given_up_when_the_finger_turns(heavy: str, parse: Parse) -> None:
    force = side(heavy.replace("force_std_n = 0.0", "force_std_n = 0.02"), parse)
    force.set_gravity(DOWN, T0)
    force.begin_tare(T0, 0.01, "ann")
    force.set_gravity([0.1, 0.0, -G], T0)
    assert force.tare.busy, "a change below the noise is not a turn"
    force.set_gravity(ALONG, T0)
    assert (force.tare.busy, force.tare.aborted_reason) == (False, "turned")
    assert (Health.OK, "the last tare was given up: the finger was turned") in force_conditions(force, T0)


def test_tare_is_given_up_by_a_slow_turn_and_not_by_the_noise_of_a_fast_stream(heavy: str, parse: Parse) -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.1, (500, 3))
    for turn_mps2, given_up in ((0.0, False), (2.0, True)):
        force = side(heavy.replace("force_std_n = 0.0", "force_std_n = 0.02"), parse)
        force.begin_tare(T0, 10.0, "ann")
        for k, error in enumerate(noise):
            force.set_gravity([DOWN[0] + error[0] + turn_mps2 * k / 500, *(DOWN[1:] + error[1:])], T0 + 2 * k * MS)
        assert force.tare.busy is not given_up


DRIFTS = 'port = "/dev/left-wrench"\ndrift_tau_s = 1.0'


def test_drift_is_followed_without_contact_and_kept_in_contact(left: str, parse: Parse) -> None:
    force = side(left.replace('port = "/dev/left-wrench"', DRIFTS), parse)
    reading = [0.0, 0.0, 0.2, 0.0, 0.0, 0.0]
    for k in range(1500):
        read(force, reading, T0 + k * 100 * MS, untouched=True)
    followed = read(force, reading, T0 + 1500 * 100 * MS, untouched=False)
    assert abs(followed[2]) < 0.01
    assert force.drift.value[2] == pytest.approx(0.2, abs=0.01)
    for k in range(1501, 1600):
        held = read(force, [0.0, 0.0, -4.8, 0.0, 0.0, 0.0], T0 + k * 100 * MS, untouched=False)
    assert held[2] == pytest.approx(followed[2] - 5.0)
    assert force.drift.frozen
    force.begin_tare(T0, 0.01, "ann")
    for k in range(12):
        read(force, reading, T0 + k * MS)
    assert force.drift.value.tolist() == [0.0] * 6
    assert force.tare.undo()
    assert force.drift.value[2] == pytest.approx(0.2, abs=0.01)


def test_drift_at_its_limit_is_reported(left: str, parse: Parse) -> None:
    force = side(left.replace('port = "/dev/left-wrench"', DRIFTS + "\ndrift_limit_n = 0.1"), parse)
    assert not force_conditions(force, T0)
    force.drift.value = np.array((0.0, 0.0, 0.1, 0.0, 0.0, 0.0))
    assert force_conditions(force, T0) == [(Health.WARN, "its zero drifted to the limit of what is followed: tare it")]


def test_the_mean_is_that_of_the_readings_between_two_times(finger: Finger, wrench: Wrench) -> None:
    samples = [wrench(T0 + k * MS, 8.0 + k, (1.0, 0.0)) for k in range(6)]
    list(finger.decide(Read(samples, [sample.t_ns for sample in samples])))
    state = finger._estimator.contact.row
    assert mean_wrench(state, T0 + MS, T0 + 4 * MS)[2] == pytest.approx(-11.0), "of the third to the fifth"
    for since_ns, until_ns, k in (
        (T0 + 5 * MS, T0 + 9 * MS, 5),
        (0, T0, 0),
        (T0 + MS, T0 + MS, 1),
        (T0 - 9, T0 - 1, 0),
    ):
        assert mean_wrench(state, since_ns, until_ns)[2] == pytest.approx(-8.0 - k), "there is none between"
