"""The values of a finger and its pad must fit each other."""

from __future__ import annotations

import pytest
from config_faults import GOOD, assert_one_fault, faults, line

from slipd import config

FAULTS = [
    (
        "axis_scale = [0.001, 0.001, -0.001]",
        "axis_scale = [0.001]",
        "finger.right.pad.axis_scale",
        "must have 3 value(s)",
    ),
    ("axis_scale = [0.001, 0.001", "axis_scale = [0.001, 0", "finger.right.pad.axis_scale", "must not contain 0"),
    (
        "electrode_m = 0.0015",
        "axis_scale = [1.0, 1.0]\nelectrode_m = 0.0015",
        "finger.left.pad.axis_scale",
        "must have 1 value(s)",
    ),
    (
        "electrode_m = 0.0015",
        "tare = [1.0]\nelectrode_m = 0.0015",
        "finger.left.pad.tare",
        "must have 128 values, got 1",
    ),
    ("axis_scale = [0.001", "charge_tau_s = 2.0\naxis_scale = [0.001", "finger.right.pad.charge_tau_s", "not charge"),
]


@pytest.mark.parametrize(("old", "new", "path", "expected"), FAULTS)
def test_keys_of_a_finger_that_do_not_fit_are_reported(old: str, new: str, path: str, expected: str) -> None:
    assert_one_fault(old, new, path, expected)


@pytest.mark.parametrize(
    ("spread", "good"), [("0.0", True), ("0.2", True), ("1.0", True), ("1.1", False), ("-0.1", False)]
)
def test_mu_spread_is_a_relative_deviation(spread: str, good: bool) -> None:
    text = GOOD.replace("mu = 0.5", f"mu = 0.5\nmu_spread = {spread}")
    if good:
        assert config.parse(text, "rig.toml").finger["left"].mu_spread == float(spread)
    else:
        [(path, at, told)] = faults(text)
        assert (path, at) == ("finger.left.mu_spread", line("mu = 0.5") + 1)
        assert told == f"must be from 0.001 to 1, got {float(spread):g}"


@pytest.mark.parametrize(("mu_max", "good"), [("0.5", True), ("2.0", True), ("0.4", False), ("2.1", False)])
def test_mu_max_must_be_at_least_mu(mu_max: str, good: bool) -> None:
    text = GOOD.replace("mu = 0.5", f"mu = 0.5\nmu_max = {mu_max}")
    if good:
        assert config.parse(text, "rig.toml").finger["left"].most_mu == float(mu_max)
    else:
        [(path, at, _)] = faults(text)
        assert (path, at) == ("finger.left.mu_max", line("mu = 0.5") + 1)


def test_a_finger_without_a_stream_is_refused() -> None:
    found = faults("[finger.left]\nmu = 0.5\n")
    assert found == [("finger.left", 1, "must have [wrench], [pad] or both, got neither")]


def test_a_pad_that_measures_no_shear_needs_a_force_sensor() -> None:
    head, _, tail = GOOD.partition("[finger.left.wrench]")
    found = faults(head + "[finger.left.pad]" + tail.partition("[finger.left.pad]")[2])
    assert [path for path, _, _ in found] == ["finger.left.wrench"]
    assert "pvdf measures no shear" in found[0][2]


PADS = [
    ("tsf85", "7", "4", "", ""),
    ("tsf85", "4", "4", "finger.right.pad.rows", "rows x cols must be 28, the taxels of one tsf85 sensor, got 4 x 4"),
    ("papillarray", "3", "3", "", ""),
    ("papillarray", "9", "3", "finger.right.pad.rows", "rows x cols must be 9"),
]


@pytest.mark.parametrize(("device", "rows", "cols", "path", "expected"), PADS)
def test_a_pad_must_have_the_taxels_and_a_sensor_of_its_device(
    device: str, rows: str, cols: str, path: str, expected: str
) -> None:
    scale = "axis_scale = [1.0, 1.0, 1.0]" if device == "papillarray" else "axis_scale = [1.0]"
    text = GOOD.replace(
        "[finger.right]", '[finger.right]\nwrench = { device = "bota", port = "/dev/w", rate_hz = 800 }'
    )
    for old, new in (
        ('"xela"', f'"{device}"'),
        ("ws://127.0.0.1:5000", "/dev/pads"),
        ('sensor = "2"', 'sensor = "1"'),
        ("rate_hz = 60.0", "rate_hz = 100.0" if device == "papillarray" else "rate_hz = 60.0"),
        ("rows = 4", f"rows = {rows}"),
        ("cols = 4", f"cols = {cols}"),
        ("axis_scale = [0.001, 0.001, -0.001]", scale),
    ):
        text = text.replace(old, new)
    if path:
        [(found, _, message)] = faults(text)
        assert found == path
        assert expected in message
    else:
        assert config.parse(text, "rig.toml").finger["right"].pad is not None
    [(found, _, message)] = faults(text.replace('sensor = "1"', 'sensor = "2"'))
    assert found == "finger.right.pad.sensor"
    assert message == f'must be "0" or "1", the sensors of {device}, got \'2\''
