"""Names, levels and shared ports of a config must fit each other."""

from __future__ import annotations

import re

import pytest
from config_faults import GOOD, assert_one_fault, faults, line

from slipd import config

FAULTS = [
    (
        'port = "/dev/left-pad"',
        'port = "/dev/left-wrench"',
        "finger.left.pad.port",
        "must differ from the port of left.wrench, or each needs a 'sensor' of its own",
    ),
    ('port = "/dev/gripper"', 'port = "/dev/left-pad"', "gripper.port", "must differ from the port of left.pad"),
    ("caution = 0.6", "caution = 0.9", "levels.caution", "must be below levels.warning, 0.85, got 0.9"),
    ("caution = 0.6", "caution = 0.04", "levels.hysteresis", "must be below levels.caution, 0.04, got 0.05"),
]


@pytest.mark.parametrize(("old", "new", "path", "expected"), FAULTS)
def test_levels_and_ports_that_do_not_fit_are_reported(old: str, new: str, path: str, expected: str) -> None:
    assert_one_fault(old, new, path, expected)


def test_all_values_that_do_not_fit_are_reported_at_once() -> None:
    text = GOOD
    for old, new in [
        ("caution = 0.6", "caution = 0.9"),
        ('port = "/dev/left-pad"', 'port = "/dev/left-wrench"'),
        ("[finger.right]", "[finger.right]\n"),
        ("max_force_n = 25.0", "max_force_n = 99.0"),
        ("axis_scale = [0.001, 0.001, -0.001]", "axis_scale = [0.001]"),
    ]:
        text = text.replace(old, new)
    assert {path for path, _, _ in faults(text)} == {
        "levels.caution",
        "finger.left.pad.port",
        "finger.right.pad.axis_scale",
        "gripper.max_force_n",
    }


@pytest.mark.parametrize("name", ["Left", "left_pad", 33 * "x", "link\u0073\u00e9", '"left hand"'])
def test_a_finger_has_a_plain_name(name: str) -> None:
    quoted = name if name.startswith('"') or name.isascii() else f'"{name}"'
    text = GOOD.replace("finger.left", f"finger.{quoted}")
    plain = name.strip('"')
    found = faults(text)
    assert [message for _, _, message in found] == [
        f"a finger name must consist of 1 to 32 characters a-z and 0-9, got {plain!r}"
    ]
    assert found[0][1] in (line("[finger.left]"), None)


def test_no_finger_name_begins_with_another() -> None:
    """A subscription matches every topic with its prefix: ``slip.left`` would match ``slip.left2`` too."""
    found = faults(GOOD.replace("finger.right", "finger.left2"))
    assert [(path, at) for path, at, _ in found] == [("finger.left2", line("[finger.right]"))]
    assert "must not begin with the name of finger 'left'" in found[0][2]


def test_two_pads_may_share_a_server_if_their_sensors_differ() -> None:
    other = re.search(r"\[finger\.right\.pad\]\n(.*\n)+?\n", GOOD)
    assert other is not None
    twin = other[0].replace("finger.right", "finger.third")
    assert config.parse(GOOD + twin.replace('"2"', '"1"'), "rig.toml").finger["third"].pad is not None
    found = faults(GOOD + twin)
    assert [path for path, _, _ in found] == ["finger.third.pad.port"]
    assert "each needs a 'sensor' of its own" in found[0][2]


def test_two_pads_of_one_server_need_the_same_options() -> None:
    """The link is opened once, with the options of the first pad; other options would be ignored silently."""
    other = re.search(r"\[finger\.right\.pad\]\n(.*\n)+?\n", GOOD)
    assert other is not None
    twin = other[0].replace("finger.right", "finger.third").replace('"2"', '"1"')
    found = faults(GOOD + twin.replace('sensor = "1"', 'sensor = "1"\noptions = { calibrated = true }'))
    assert [path for path, _, _ in found] == ["finger.third.pad.options"]


@pytest.mark.parametrize(("key", "value"), [("baud", "9600"), ("hardware_id", '"S/N 1"')])
def test_two_sensors_of_one_port_need_the_same_baud_and_hardware_id(key: str, value: str) -> None:
    other = re.search(r"\[finger\.right\.pad\]\n(.*\n)+?\n", GOOD)
    assert other is not None
    twin = other[0].replace("finger.right", "finger.third").replace('"2"', '"1"')
    found = faults(GOOD + twin.replace('sensor = "1"', f'sensor = "1"\n{key} = {value}'))
    assert [path for path, _, _ in found] == [f"finger.third.pad.{key}"]


def test_files_that_follow_each_other_are_not_deleted_at_once() -> None:
    [(path, _, message)] = faults(f"{GOOD}\n[recording.continuous]\nkeep_bytes = 300_000_000\n")
    assert path == "recording.continuous.keep_bytes"
    assert message == "must be at least twice recording.continuous.file_bytes, 200000000, got 300000000"
