"""A finger has a plain name, streams that suffice, and pads with the taxels and sensors of their device."""

from __future__ import annotations

import re

import pytest
from config_faults import GOOD, faults, line

from slipd import config


@pytest.mark.parametrize("name", ["Left", "left_pad", 33 * "x", "links\u00e9", "left hand"])
def test_a_finger_has_a_plain_name(name: str) -> None:
    [(_, at, message)] = faults(GOOD.replace("finger.left", f'finger."{name}"'))
    assert message == f"a finger name must consist of 1 to 32 characters a-z and 0-9, got {name!r}"
    assert at in (line("[finger.left]"), None)


def test_no_finger_name_begins_with_another() -> None:
    """A subscription matches every topic with its prefix: ``slip.left`` would match ``slip.left2`` too."""
    [(path, at, message)] = faults(GOOD.replace("finger.right", "finger.left2"))
    assert (path, at) == ("finger.left2", line("[finger.right]"))
    assert "must not begin with the name of finger 'left'" in message


@pytest.mark.parametrize(
    ("sensor", "key"),
    [
        ('"1"', ""),
        ('"2"', "port"),
        ('"1"\noptions = { calibrated = true }', "options"),
        ('"1"\nbaud = 9600', "baud"),
        ('"1"\nhardware_id = "S/N 1"', "hardware_id"),
    ],
)
def test_two_pads_may_share_a_server_if_only_their_sensors_differ(sensor: str, key: str) -> None:
    """The link is opened once, with the keys of the first pad; others would be ignored silently."""
    other = re.search(r"\[finger\.right\.pad\]\n(.*\n)+?\n", GOOD)
    assert other is not None
    text = GOOD + other[0].replace("finger.right", "finger.third").replace('"2"', sensor)
    if key:
        assert [path for path, _, _ in faults(text)] == [f"finger.third.pad.{key}"]
    else:
        assert config.parse(text, "rig.toml").finger["third"].pad is not None


def test_a_finger_has_a_stream_and_a_pad_that_measures_no_shear_needs_a_force_sensor() -> None:
    assert faults("[finger.left]\nmu = 0.5\n") == [("finger.left", 1, "must have [wrench], [pad] or both, got neither")]
    head, _, tail = GOOD.partition("[finger.left.wrench]")
    [(path, _, message)] = faults(head + "[finger.left.pad]" + tail.partition("[finger.left.pad]")[2])
    assert (path, "pvdf measures no shear" in message) == ("finger.left.wrench", True)


def test_the_decoder_of_a_scanned_pad_gets_its_size() -> None:
    rig = config.parse(GOOD, "rig.toml")
    pads = [finger.pad for finger in rig.finger.values() if finger.pad is not None]
    assert [config.device_options(pad) for pad in pads] == [{"rows": 8, "cols": 16}, {}]


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
        assert (found, message[: len(expected)]) == (path, expected)
    else:
        assert config.in_newtons(config.parse(text, "rig.toml").finger["right"].pad) is (device == "papillarray")
    [(found, _, message)] = faults(text.replace('sensor = "1"', 'sensor = "2"'))
    assert (found, message) == ("finger.right.pad.sensor", f'must be "0" or "1", the sensors of {device}, got \'2\'')
