"""`slipd check` warns of values that are possible but suspicious, with their line and what was probably meant."""

from __future__ import annotations

from pathlib import Path

import pytest
from config_faults import GOOD
from project import CONFIG

from slipd import config
from slipd.config import check_hints

QUIET = GOOD.replace("axis_scale =", "tare = [" + "0.0, " * 48 + "]\naxis_scale =").replace(
    "[finger.right]\n", "[finger.right]\nmu = 0.5\n"
)
"""A config without a warning."""


def hints(text: str) -> list[str]:
    return list(config.hints(config.parse(text, "rig.toml"), "rig.toml"))


def line(text: str, start: str) -> int:
    return next(n for n, row in enumerate(text.splitlines(), start=1) if row.startswith(start))


def test_a_good_config_is_not_warned_of() -> None:
    assert hints(QUIET) == []


@pytest.mark.parametrize(
    ("old", "new", "key", "expected"),
    [
        ("mu = 0.5", "mu = 1.21", "finger.left.mu", "1.21 is more than rubber usually has"),
        ("mu = 0.5", "mu = 2.0", "finger.left.mu", "did you mean 0.2?"),
        ("pitch_m = 0.0032", "pitch_m = 0.0096", "finger.left.pad.pitch_m", "8 x 16 taxels make a pad 0.1536 m long"),
        (
            "rate_hz = 800",
            "rate_hz = 50",
            "finger.left.wrench.rate_hz",
            "at 50 Hz the force shows slips late or not at all",
        ),
        ("rate_hz = 800", "mass_kg = 8.5\nrate_hz = 800", "finger.left.wrench.mass_kg", "8.5 kg beyond the sensor"),
        (
            "rate_hz = 800",
            "com_m = [0, 0, 0.5]\nrate_hz = 800",
            "finger.left.wrench.com_m",
            "0.5 m from the pad is far",
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


def test_the_values_that_are_still_examples_are_counted() -> None:
    text = (CONFIG / "gauges_pvdf.toml").read_text(encoding="utf-8")
    (hint,) = hints(text)
    count = sum("# MEASURE" in row for row in text.splitlines())
    assert hint.startswith(f"rig.toml:{line(text, 'mu = 0.55')}: warning: {count} values are still marked MEASURE")
    assert hints(text.replace("# MEASURE", "#")) == []
