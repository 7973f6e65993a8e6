"""A value that no rig can have is refused, with the unit that was probably meant."""

from __future__ import annotations

import pytest
from config_faults import GOOD, assert_one_fault, broken, faults, line

from slipd import config

IMPOSSIBLE = [
    (
        "pitch_m = 0.0032",
        "pitch_m = 3.2",
        "finger.left.pad.pitch_m",
        "must be from 0.0001 to 0.05 m, got 3.2: did you mean 3.2 mm? write 0.0032",
    ),
    ("pitch_m = 0.0032", "pitch_m = 1e-6", "finger.left.pad.pitch_m", "must be from 0.0001 to 0.05 m, got 1e-06"),
    ("pitch_m = 0.0032", "pitch_m = 0.04", "finger.left.pad.pitch_m", "the pad must be at most 0.5 m long, got 0.64 m"),
    ("electrode_m = 0.0015", "electrode_m = 1.5", "finger.left.pad.electrode_m", "did you mean 1.5 mm? write 0.0015"),
    (
        "electrode_m = 0.0015",
        "electrode_m = 0.0033",
        "finger.left.pad.electrode_m",
        "must be at most pitch_m, 0.0032 m",
    ),
    (
        "rate_hz = 800",
        "rate_hz = 800\npad_from_sensor = { xyz_m = [0.0, 0.0, -25.0] }",
        "finger.left.wrench.pad_from_sensor.xyz_m",
        "must be from -1 to 1 m, got -25: did you mean -25 mm? write -0.025",
    ),
    (
        "rate_hz = 800",
        "rate_hz = 800\nmass_kg = 85.0",
        "finger.left.wrench.mass_kg",
        "must be from 1e-05 to 10 kg, got 85: did you mean 85 g? write 0.085",
    ),
    ("rate_hz = 800", "rate_hz = 800\nmass_kg = -0.1", "finger.left.wrench.mass_kg", "got -0.1"),
    ("rate_hz = 800", "rate_hz = 800\ncom_m = [0.0, 2.0, 0.0]", "finger.left.wrench.com_m", "did you mean 2 mm?"),
    ("rate_hz = 800", "rate_hz = 800\nforce_std_n = 20.0", "finger.left.wrench.force_std_n", "did you mean 20 mN?"),
    (
        "rate_hz = 800",
        "rate_hz = 800\nrange_n = 0.2",
        "finger.left.min_normal_n",
        "below wrench.range_n, 0.2 N, got 0.3",
    ),
    ("mu = 0.5", "mu = 2.1", "finger.left.mu", "must be from 0.01 to 2, got 2.1"),
    ("mu = 0.5", "mu = 5", "finger.left.mu", "must be from 0.01 to 2, got 5: did you mean 0.5?"),
    ("mu = 0.5", "mu = 55.0", "finger.left.mu", "must be from 0.01 to 2, got 55: did you mean 0.55?"),
    (
        "rate_hz = 800",
        "rate_hz = 800\npad_from_sensor = { quat_xyzw = [0.0, 0.0, 0.7, 0.7] }",
        "finger.left.wrench.pad_from_sensor.quat_xyzw",
        "got one of length 0.9899: its digits are too few; write [0.0, 0.0, 0.7071068, 0.7071068]",
    ),
    ("mu = 0.5", "mu = 0.5\nmin_normal_n = 60.0", "finger.left.min_normal_n", "must be at most 50 N, got 60"),
    (
        "rate_hz = 800",
        "rate_hz = 4000",
        "finger.left.wrench.rate_hz",
        "must be from 25.01 to 800 Hz, the rates of bota, got 4000",
    ),
    (
        "rate_hz = 800",
        "rate_hz = 0.00125",
        "finger.left.wrench.rate_hz",
        "did you mean a period of 0.00125 s? write 800",
    ),
    (
        "rate_hz = 800",
        "rate_hz = 800\nbaud = 115200",
        "finger.left.wrench.rate_hz",
        "at most 311 Hz, the most that bota can send at 115200 bit/s, got 800; lower it or raise baud (default 460800)",
    ),
    (
        "rate_hz = 50.0",
        "rate_hz = 500.0",
        "gripper.rate_hz",
        "must be from 1 to 200 Hz, the rates of robotiq_2f, got 500",
    ),
    (
        "force_table = [[0, 3.0], [255, 30.0]]",
        "force_table = [[0, 3.0], [255, 3000.0]]",
        "gripper.force_table",
        "must have a largest force on one pad of at most 235 N, the most of any robotiq_2f, got 3000",
    ),
    (
        "speed_table = [[0, 0.02], [255, 0.15]]",
        "speed_table = [[0, 20.0], [255, 150.0]]",
        "gripper.speed_table",
        "must be from 0 to 2 m/s, got 20: did you mean 20 mm/s? write 0.02",
    ),
    (
        "speed_table = [[0, 0.02], [255, 0.15]]",
        "speed_table = [[0, 0.02], [255, 1.5]]",
        "gripper.speed_table",
        "must have a largest speed of at most 0.25 m/s, the most of any robotiq_2f, got 1.5",
    ),
    ("  [0.0, 0.085]", "  [0.0, 85.0]", "gripper.width_table", "must be from 0 to 1 m, got 85: did you mean 85 mm?"),
    ("  [0.0, 0.085]", "  [0.0, 0.85]", "gripper.width_table", "must have a stroke of at most 0.14 m"),
    ("max_force_n = 25.0", "max_force_n = 25.0\nraise_n_per_s = 1e9", "gripper.raise_n_per_s", "got 1e+09"),
    ("caution = 0.6", "caution = 0.6\n[reflex]\ncalm_s = 1e9", "reflex.calm_s", "must be from 0.001 to 3600 s"),
]


@pytest.mark.parametrize(("old", "new", "path", "expected"), IMPOSSIBLE)
def test_an_impossible_value_is_refused_with_the_likely_meaning(old: str, new: str, path: str, expected: str) -> None:
    assert_one_fault(old, new, path, expected)


def test_a_range_that_no_sensor_has_is_refused() -> None:
    [(path, _, message)] = faults(broken("rate_hz = 800", "rate_hz = 800\nrange_n = 1e7"))
    assert path == "finger.left.wrench.range_n"
    assert message == "must be from 0.1 to 100000 N, got 1e+07"


def test_pad_positions_in_millimetres_are_refused() -> None:
    text = (
        config.shipped("demo.toml").read_text(encoding="utf-8").replace("[0.085, 0.0, 0.0425, 0.0]", "[85, 0, 42, 0]")
    )
    [(path, at, message)] = faults(text)
    assert path == "grasp.pads.left.positions"
    assert message == "must be from 0 to 1 m, got 85: did you mean 85 mm? write 0.085"
    assert at is not None
    assert "85, 0, 42, 0" in text.splitlines()[at - 1]


@pytest.mark.parametrize(("quaternion", "length"), [("[0, 0, 0, 0]", "0"), ("[5, 0, 0, 3]", "5.831")])
def test_a_quaternion_that_is_not_a_rotation_is_refused(quaternion: str, length: str) -> None:
    text = broken("rate_hz = 800", f"rate_hz = 800\npad_from_sensor = {{ quat_xyzw = {quaternion} }}")
    [(path, at, message)] = faults(text)
    assert (path, at) == ("finger.left.wrench.pad_from_sensor.quat_xyzw", line("rate_hz = 800") + 1)
    assert message.endswith(f"got one of length {length}")


@pytest.mark.parametrize("rate", ["1e-300", "1e300"])
@pytest.mark.parametrize("key", ["rate_hz = 800", "caution = 0.6"])
def test_a_rate_that_no_stream_has_is_refused(rate: str, key: str) -> None:
    if key.startswith("rate"):
        found = faults(broken(key, f"rate_hz = {rate}"))
        assert [path for path, _, _ in found] == ["finger.left.wrench.rate_hz"]
    else:
        found = faults(f"[rates]\nslip_hz = {rate}\n" + GOOD)
        assert [path for path, _, _ in found] == ["rates.slip_hz"]
