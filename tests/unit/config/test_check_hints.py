"""`slipd check` warns of values that are possible but suspicious, with their line and what was probably meant."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from config_faults import GOOD
from project import CONFIG

from slipd import config
from slipd.config import check_hints

QUIET = (
    GOOD.replace("axis_scale =", "tare = [" + "0.0, " * 48 + "]\naxis_scale =")
    .replace("[finger.right]\n", "[finger.right]\nmu = 0.5\n")
    .replace("electrode_m = 0.0015", "electrode_m = 0.0015\ncharge_tau_s = 2.0")
)
"""A config without a warning."""


def hints(text: str) -> list[str]:
    return list(config.hints(config.parse(text, "rig.toml"), "rig.toml"))


def line(text: str, start: str) -> int:
    return next(n for n, row in enumerate(text.splitlines(), start=1) if row.startswith(start))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("", ""),
        ("mu = 0.5", "mu = 1.2"),
        ("pitch_m = 0.0032", "pitch_m = 0.0075"),
        ("rate_hz = 800", "rate_hz = 100\noptions = { sinc_length = 512 }"),
        ("rate_hz = 800", "rate_hz = 800\nbaud = 460800"),
        ("rate_hz = 800", "mass_kg = 2.0\ncom_m = [0.0, 0.3, 0.0]\nrate_hz = 800"),
        ("rate_hz = 800", "pad_from_sensor = { xyz_m = [0.0, 0.0, -0.3] }\nrate_hz = 800"),
        ("caution = 0.6", "caution = 0.6\nwarning = 0.95"),
        ('"pvdf"\n', '"wts"\noptions = { interval_ms = 0 }\n'),  # as fast as it can, so that it has any rate
    ],
)
def test_a_good_config_is_not_warned_of_nor_a_value_at_the_edge_of_the_usual(old: str, new: str) -> None:
    assert hints(QUIET.replace(old, new, 1)) == []


@pytest.mark.parametrize(
    ("old", "new", "key", "expected"),
    [
        ("mu = 0.5", "mu = 1.21", "finger.left.mu", "1.21 is more than rubber usually has"),
        ("mu = 0.5", "mu = 2.0", "finger.left.mu", "did you mean 0.2?"),
        ("pitch_m = 0.0032", "pitch_m = 0.0096", "finger.left.pad.pitch_m", "8 x 16 taxels make a pad 0.1536 m long"),
        (
            "rate_hz = 800",
            "rate_hz = 50\noptions = { sinc_length = 1024 }",
            "finger.left.wrench.rate_hz",
            "at 50 Hz the force shows slips late or not at all",
        ),
        (
            "rate_hz = 800",
            "rate_hz = 100",
            "finger.left.wrench.rate_hz",
            "but options.sinc_length = 64, its default, sets 800 Hz: write rate_hz = 800, or options.sinc_length = 512",
        ),
        (
            'device = "bota"\nport = "/dev/left-wrench"\nrate_hz = 800',
            'device = "netft"\nport = "udp://10.0.0.1:49152"\nrate_hz = 800\n'
            'options = { calibration = "xml", output_hz = 100 }',
            "finger.left.wrench.rate_hz",
            "options.output_hz = 100 sets 100 Hz: write rate_hz = 100, or options.output_hz = 800",
        ),
        (
            "rate_hz = 800",
            "rate_hz = 800\nbaud = 921600",
            "finger.left.wrench.baud",
            "bota has 460800 bit/s by default, got 921600: no reading arrives unless the device itself was set to that",
        ),
        (
            "charge_tau_s = 2.0",
            "",
            "finger.left.pad",
            "no charge_tau_s, which pvdf does not report: R · C of the charge amplifiers",
        ),
        ("rate_hz = 800", "mass_kg = 8.5\nrate_hz = 800", "finger.left.wrench.mass_kg", "8.5 kg beyond the sensor"),
        (
            "rate_hz = 800",
            "com_m = [0, 0, 0.5]\nrate_hz = 800",
            "finger.left.wrench.com_m",
            "0.5 m from the pad is far",
        ),
        *(
            (
                "rate_hz = 800",
                f"pad_from_sensor = {{ quat_xyzw = {quaternion} }}\nrate_hz = 800",
                "finger.left.wrench.pad_from_sensor",
                "in the order w, x, y, z it would be the identity: is its order x, y, z, w?",
            )
            for quaternion in ("[1.0, 0.0, 0.0, 0.0]", "[-1.0, 0.0, 0.0, 0.0]")
        ),
        ("caution = 0.6", "caution = 0.6\nwarning = 0.99", "levels.warning", "0.99 leaves no time to act"),
        ("max_force_n = 25.0", "", "gripper", "no max_force_n: no request can move the gripper"),
        ("mu = 0.5", "", "finger.left", "no mu: it warns of nothing"),
        (
            'port = "/dev/gripper"',
            'port = "/dev/ttyUSB7"',
            "gripper.port",
            "whichever device is plugged in first: use a path below /dev/serial/by-id",
        ),
    ],
)
def test_a_suspicious_value_is_warned_of_with_its_line(old: str, new: str, key: str, expected: str) -> None:
    text = QUIET.replace(old, new, 1)
    (hint,) = hints(text)
    assert f": warning: {key}: " in hint
    assert expected in hint
    for row in new.splitlines():
        if row.startswith(f"{key.rpartition('.')[2]} = "):
            assert hint.startswith(f"rig.toml:{line(text, row)}: ")


def test_a_numbered_port_is_answered_with_its_stable_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    by_id, by_path = tmp_path / "by-id", tmp_path / "by-path"
    monkeypatch.setattr(check_hints, "STABLE_NAMES", (by_id, by_path))
    text = QUIET.replace('port = "/dev/gripper"', 'port = "/dev/ttyUSB7"')
    for folder in (by_path, by_id):
        folder.mkdir()
        (folder / "adapter").symlink_to("/dev/ttyUSB7")
        (folder / "another").symlink_to("/dev/ttyUSB8")
        (hint,) = hints(text)
        assert hint.endswith(
            f": gripper.port: /dev/ttyUSB7 is whichever device is plugged in first: write {folder}/adapter"
        )


@pytest.mark.parametrize("path", sorted(CONFIG.glob("*.toml")), ids=lambda path: path.name)
def test_the_values_that_are_still_examples_are_named_on_every_finger(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    found = [hint for hint in hints(text) if "MEASURE" in hint]
    assert sum(hint.count(",") + 1 for hint in found) == len(re.findall(r"^\w+ = .*# .*MEASURE", text, re.MULTILINE))
    assert sum("finger.left.wrench:" in hint for hint in found) == sum("finger.right.wrench:" in hint for hint in found)
    assert not [hint for hint in hints(text.replace("MEASURE", "")) if "MEASURE" in hint or "sets" in hint]


OPTOFORCE = """\
[finger.left]
mu = 0.5
[finger.left.wrench]
device = "optoforce"
port = "/dev/left-wrench"
rate_hz = 20.0
"""


@pytest.mark.parametrize(
    ("port", "scale", "rate"),
    [
        ("/dev/left-wrench", True, "write rate_hz = 1000"),  # it has no period of 50 ms
        ("udp://192.168.1.1:49152", False, "write rate_hz = 1000, or options.period_ms = 50"),  # the converter: newtons
    ],
)
def test_a_serial_optoforce_lacks_its_scale_and_has_another_rate(port: str, scale: bool, rate: str) -> None:
    found = hints(OPTOFORCE.replace("/dev/left-wrench", port))
    lacks = "no options.counts_per_n, which optoforce does not report: counts at nominal"
    assert any(lacks in hint for hint in found) == scale
    assert any(hint.endswith(rate) for hint in found)
