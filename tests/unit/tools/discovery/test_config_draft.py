from __future__ import annotations

from pathlib import Path

import pytest
from other_packages import Install, install

from slipd import config
from slipd.config.config_file import marked_keys
from slipd.devices import DEVICES
from slipd.tools.discovery.config_draft import draft
from slipd.tools.discovery.port_probe import NUMBER, Found, SerialPort

__all__ = ["install"]


def port(name: str, warning: str = "") -> SerialPort:
    return SerialPort(Path("/dev/serial/by-id") / name, warning)


def test_the_draft_of_every_device_is_a_valid_config() -> None:
    found = [
        (port("a"), Found("bota", 800.0)),
        (port("b", NUMBER), Found("robotous", identity="RFT40")),
        (port("c"), Found("tsf85", 60.0, "1.1.8", 28, sensors=("0", "1"))),
        (port("g"), Found("robotiq_2f")),
    ]
    text = draft(found, [port("nothing")], "my_rig.toml")
    rig = config.parse(text, "draft")
    assert list(rig.streams()) == ["left.wrench", "left.pad", "right.wrench", "right.pad", "gripper"]
    assert [rig.finger[name].pad.sensor for name in ("left", "right")] == ["0", "1"]  # type: ignore[union-attr]
    assert rig.gripper.max_force_n is None, "nothing may move before a person stated the limit"
    assert rig.recording.incidents.enabled, "what happened before a warning can be seen"
    for words in ("slipd commission my_rig.toml", "/dev/serial/by-id/nothing: no device", NUMBER, "it reports: RFT40"):
        assert words in text


def test_a_device_of_another_package_names_it(install: Install) -> None:
    install("slipd-anyskin", "anyskin", "slipd_anyskin:DEVICE")
    rig = config.parse(draft([(port("a"), Found("anyskin", 100.0, taxels=5))], [], "rig.toml"), "draft")
    assert rig.streams()["left.pad"].package == "slipd-anyskin"


@pytest.mark.parametrize(
    "found",
    [
        Found("pvdf", 200.0, taxels=128, rows=8),
        Found("wts", 100.0, taxels=84),
        Found("dsacon32", 30.0, taxels=84, sensors=("0", "1")),
        Found("papillarray", 500.0, taxels=9, sensors=("0", "1")),
        Found("gauges", 1000.0),
        Found("optoforce", 100.0),
    ],
    ids=lambda found: found.device,
)
def test_each_device_makes_a_valid_config(found: Found) -> None:
    alone = DEVICES[found.device].kind == "wrench" or DEVICES[found.device].axes == 3
    beside = [] if alone else [(port("w"), Found("bota", 800.0))]
    rig = config.parse(draft([(port("a"), found), *beside], [], "rig.toml"), "draft")
    marked = {".".join(path[-2:]) for path in marked_keys(rig.text)}
    for need in DEVICES[found.device].needs:
        assert not need.guess or any(key.endswith(need.key) for key in marked), need.key
        assert need.how in rig.text
    assert not [hint for hint in config.hints(rig, "rig.toml") if " sets " in hint], "rate and options agree"
    pad = rig.finger["left"].pad
    assert pad is None or pad.rows * pad.cols == found.taxels
