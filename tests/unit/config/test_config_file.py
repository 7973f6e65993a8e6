"""A config that cannot be run is refused as a whole, and every fault is reported with its line."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from config_faults import GOOD, broken, faults, line
from project import CONFIG

from slipd import config
from slipd.errors import ConfigError

SHIPPED = sorted(CONFIG.glob("*.toml"))


def test_the_good_config_is_good() -> None:
    rig = config.parse(GOOD, "rig.toml")
    assert list(rig.streams()) == ["left.wrench", "left.pad", "right.pad", "gripper"]
    assert rig.levels.caution == 0.6
    assert rig.finger["left"].mu == 0.5
    assert rig.finger["right"].mu is None
    assert rig.gripper is not None
    assert rig.gripper.force_table == [(0.0, 3.0), (255.0, 30.0)]


def test_the_id_of_a_config_changes_with_its_text() -> None:
    ids = {config.parse(text, "rig.toml").config_id for text in (GOOD, GOOD + "\n", GOOD + "# note\n")}
    assert len(ids) == 3
    assert config.parse(GOOD, "a").config_id == config.parse(GOOD, "b").config_id
    assert all(re.fullmatch("[0-9a-f]{12}", config_id) for config_id in ids)


@pytest.mark.parametrize(
    ("old", "new", "path", "expected"),
    [
        ("caution = 0.6", "cautoin = 0.6", "levels.cautoin", "unknown key; did you mean 'caution'?"),
        (
            "caution = 0.6",
            "zzz = 0.6",
            "levels.zzz",
            "unknown key; known here: caution, false_alarms_per_hour, hysteresis, warning",
        ),
        ("mu = 0.5", 'mu = "slippery"', "finger.left.mu", "must be a number, got 'slippery'"),
        ("mu = 0.5", "mu = nan", "finger.left.mu", "finite number"),
        ("mu = 0.5", "mu = -0.5", "finger.left.mu", "must be from 0.01 to 2, got -0.5"),
        ("mu = 0.5", "load_rul = 0.5", "finger.left.load_rul", "did you mean 'load_rule'?"),
        ("rows = 8", "rows = 8.5", "finger.left.pad.rows", "must be an integer"),
        ("rows = 8", "rows = 0", "finger.left.pad.rows", "must be above 0, got 0"),
        ("rows = 8", "rows = true", "finger.left.pad.rows", "must be an integer"),
        ("pitch_m = 0.0032", "pitch_mm = 3.2", "finger.left.pad.pitch_mm", "did you mean 'pitch_m'?"),
        ("rate_hz = 800", "rate_hz = inf", "finger.left.wrench.rate_hz", "finite number"),
        ("max_force_n = 25.0", "max_force_n = inf", "gripper.max_force_n", "finite number"),
        ('device = "bota"', "device = 7", "finger.left.wrench.device", "must be a text in quotes, got 7"),
    ],
)
def test_G1_a_wrong_value_is_reported_with_its_line(old: str, new: str, path: str, expected: str) -> None:
    found = faults(broken(old, new))
    assert (path, line(old)) in [(found_path, found_line) for found_path, found_line, _ in found]
    assert any(expected in message for found_path, _, message in found if found_path == path), found


def test_control_characters_of_a_config_are_escaped_in_its_faults() -> None:
    text = broken("caution = 0.6", r'"\u001b[31mcaution\n" = 0.6').replace("/dev/left-wrench", r"/dev/\u0007")
    with pytest.raises(ConfigError) as raised:
        config.parse(text, "rig\x1b.toml")
    assert all(told.isprintable() for told in str(raised.value).split("\n"))
    assert r"levels.\x1b[31mcaution\n: unknown key; did you mean 'caution'" in str(raised.value)
    assert r"must be a text without control characters, got '/dev/\x07'" in str(raised.value)


@pytest.mark.parametrize(
    ("old", "path", "at"),
    [
        ('port = "/dev/left-wrench"', "finger.left.wrench.port", "[finger.left.wrench]"),
        ("rows = 8", "finger.left.pad.rows", "[finger.left.pad]"),
        ("max_force", "gripper.max_force_n", ""),
        ("width_table = [\n  [0.0, 0.085],\n  [1.0, 0.0]\n]", "gripper.width_table", "[gripper]"),
    ],
)
def test_a_missing_key_is_reported_with_the_line_of_its_table(old: str, path: str, at: str) -> None:
    text = broken(old, f"# {old}".replace("\n", "\n# "))
    if not at:  # no limit is a config that moves nothing, not a fault
        assert config.parse(text, "rig.toml").gripper is not None
        return
    ((found_path, found_line, reason),) = faults(text)
    assert (found_path, found_line, reason.startswith("is missing")) == (path, line(at), True)


def test_wrong_values_do_not_hide_values_that_do_not_fit_each_other() -> None:
    text = GOOD.replace("mu = 0.5", "mu = -0.5").replace("caution = 0.6", "caution = 0.6\nwarning = 0.6")
    assert [path for path, _, _ in faults(text)] == ["finger.left.mu", "levels.caution"]


def test_G1_all_wrong_values_are_reported_at_once() -> None:
    text = GOOD.replace("mu = 0.5", "mu = -1").replace("rows = 8", "rows = 0").replace("pitch_m = 0.0047", "pitch = 1")
    assert {(path, at) for path, at, _ in faults(text)} == {
        ("finger.left.mu", line("mu = 0.5")),
        ("finger.left.pad.rows", line("rows = 8")),
        ("finger.right.pad.pitch", line("pitch_m = 0.0047")),
        ("finger.right.pad.pitch_m", line("[finger.right.pad]")),
    }


def test_the_error_has_one_line_per_fault_with_file_and_line() -> None:
    with pytest.raises(ConfigError) as caught:
        config.parse(GOOD.replace("mu = 0.5", "mu = -1").replace("rows = 8", "rows = 0"), "rig.toml")
    assert str(caught.value).splitlines() == [
        f"rig.toml:{line('mu = 0.5')}: finger.left.mu: must be from 0.01 to 2, got -1",
        f"rig.toml:{line('rows = 8')}: finger.left.pad.rows: must be above 0, got 0",
    ]


@pytest.mark.parametrize(
    ("text", "at"),
    [
        ("[finger.left\nmu = 1", 1),
        ("a = 1\nb = \n", 2),
        ("a = {b = 1, b = 2}\n", 1),
        ("a = " + "1" * 5000, None),
        ("a = " + "[" * 5000, None),
    ],
)
def test_a_text_that_is_not_toml_is_refused(text: str, at: int | None) -> None:
    found = faults(text)
    assert [(path, line) for path, line, _ in found] == [("", at)]
    assert found[0][2].startswith("not TOML: ")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "[finger.left]\nmu = 0,5  # rubber\n",
            (2, "mu must be written with a decimal point, got 0,5: write mu = 0.5"),
        ),
        (
            "[finger.left]\nmu = 0.5\n[finger.left.pad]\ntare = [\n  1,\n]\ntare = [\n  2,\n]\n",
            (7, "finger.left.pad.tare is written twice, first in line 4; keep one of them"),
        ),
        ("[levels]\n[bus]\n[levels]\n", (3, "levels is written twice, first in line 1; keep one of them")),
    ],
)
def test_a_usual_slip_of_the_pen_is_named_in_the_words_of_a_config(text: str, expected: tuple[int, str]) -> None:
    assert faults(text) == [("", *expected)]


@pytest.mark.parametrize("text", ["", "[levels]\n", "finger = 3\n", "[finger]\n"])
def test_a_config_without_a_finger_is_refused(text: str) -> None:
    assert "finger" in [path for path, _, _ in faults(text)]


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    for name, expected in (("none.toml", "No such file"), (".", "Is a directory")):
        with pytest.raises(ConfigError, match=expected):
            config.load(tmp_path / name)
    (tmp_path / "latin.toml").write_bytes(b"# \xe9\n")
    with pytest.raises(ConfigError, match=r"latin\.toml: cannot be read: it is not UTF-8 text"):
        config.load(tmp_path / "latin.toml")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root becomes another user")
def test_a_config_of_root_alone_is_refused_to_the_user_of_the_service_with_the_remedy(tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text("", encoding="utf-8")
    file.chmod(0o600)
    nobody = 65534
    os.seteuid(nobody)
    try:
        with pytest.raises(ConfigError, match=r"cannot be read: Permission denied for user \w+; run chmod a\+r"):
            config.load(file)
    finally:
        os.seteuid(0)
