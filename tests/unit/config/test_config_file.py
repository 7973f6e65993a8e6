"""A config that cannot be run is refused as a whole, and every fault is reported with its line."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from config_faults import GOOD, broken, faults, line

from slipd import config
from slipd.errors import ConfigError


def test_the_good_config_is_good() -> None:
    rig = config.parse(GOOD, "rig.toml")
    assert rig.gripper is not None
    assert (rig.levels.caution, rig.finger["left"].mu, rig.finger["right"].mu) == (0.6, 0.5, None)
    assert (list(rig.streams())[-1], rig.gripper.force_table) == ("gripper", [(0.0, 3.0), (255.0, 30.0)])


def test_the_id_of_a_config_changes_with_its_text_alone() -> None:
    texts = (GOOD, GOOD + "\n", GOOD + "# note\n")
    ids = [config.parse(text, name).config_id for text in texts for name in ("a", "b")]
    assert len(set(ids)) == len(set(ids[::2])) == 3
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
        ("mu = 0.5", "mass_kg = 0.1", "finger.left.mass_kg", "it belongs in [finger.left.wrench]"),
        ("caution = 0.6", "rows = 8", "levels.rows", "it belongs in [finger.NAME.pad]"),
        ("caution = 0.6", "positions = 8", "levels.positions", "it belongs in [grasp.pads.NAME]"),
        ("mu = 0.5", "rate_hz = 8", "finger.left.rate_hz", "in [finger.left.wrench] or [finger.left.pad]"),
        ("mu = 0.5", "slip = 3", "finger.left.slip", "must be a table, got 3"),
        ('port = "/dev/gripper"', 'port = ""', "gripper.port", "must not be empty"),
        ("mu = 0.5", 'mu = "slippery"', "finger.left.mu", "must be a number, got 'slippery'"),
        ("mu = 0.5", "mu = nan", "finger.left.mu", "finite number"),
        ("mu = 0.5", "mu = -0.5", "finger.left.mu", "must be from 0.01 to 2, got -0.5"),
        ("mu = 0.5", "load_rul = 0.5", "finger.left.load_rul", "did you mean 'load_rule'?"),
        ("rows = 8", "rows = 8.5", "finger.left.pad.rows", "must be an integer"),
        ("rows = 8", "rows = 0", "finger.left.pad.rows", "must be above 0, got 0"),
        ("rows = 8", "rows = true", "finger.left.pad.rows", "must be an integer, got true"),
        ("mu = 0.5", "mu = [true, 'low']", "finger.left.mu", 'must be a number, got [true, "low"]'),
        ("pitch_m = 0.0032", "pitch_mm = 3.2", "finger.left.pad.pitch_mm", "did you mean 'pitch_m'?"),
        ("rate_hz = 800", "rate_hz = inf", "finger.left.wrench.rate_hz", "finite number"),
        ("max_force_n = 25.0", "max_force_n = inf", "gripper.max_force_n", "finite number"),
        ('device = "bota"', "device = 7", "finger.left.wrench.device", "must be a text in quotes, got 7"),
    ],
)
def test_G1_a_wrong_value_is_reported_with_its_line(old: str, new: str, path: str, expected: str) -> None:
    assert any(
        (found, at) == (path, line(old)) and expected in message for found, at, message in faults(broken(old, new))
    )


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
        ("width_table = [\n  [0.0, 0.085],\n  [1.0, 0.0]\n]", "gripper.width_table", "[gripper]"),
    ],
)
def test_a_missing_key_is_reported_with_the_line_of_its_table(old: str, path: str, at: str) -> None:
    ((found_path, found_line, reason),) = faults(broken(old, f"# {old}".replace("\n", "\n# ")))
    assert (found_path, found_line, reason.startswith("is missing")) == (path, line(at), True)


def test_wrong_values_do_not_hide_values_that_do_not_fit_each_other() -> None:
    text = GOOD.replace("mu = 0.5", "mu = -0.5").replace("caution = 0.6", "caution = 0.6\nwarning = 0.6")
    assert [path for path, _, _ in faults(text)] == ["finger.left.mu", "levels.caution"]


def test_G1_all_wrong_values_are_reported_at_once_one_in_a_line_with_file_and_line() -> None:
    text = GOOD.replace("mu = 0.5", "mu = -1").replace("rows = 8", "rows = 0").replace("pitch_m = 0.0047", "pitch = 1")
    with pytest.raises(ConfigError) as caught:
        config.parse(text, "rig.toml")
    told = str(caught.value).splitlines()
    assert told[:2] == [
        f"rig.toml:{line('mu = 0.5')}: finger.left.mu: must be from 0.01 to 2, got -1",
        f"rig.toml:{line('rows = 8')}: finger.left.pad.rows: must be above 0, got 0",
    ]
    assert {(fault.path, fault.line) for fault in caught.value.faults[2:]} == {
        ("finger.right.pad.pitch", line("pitch_m = 0.0047")),
        ("finger.right.pad.pitch_m", line("[finger.right.pad]")),
    }


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
    ((path, line, reason),) = faults(text)
    assert (path, line, reason.startswith("not TOML: ")) == ("", at, True)


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
        ("[levels]\ncaution: 0.5\n", (2, 'not TOML: a key and its value must be joined by "=", not ":"')),
        ("a = “b”\n", (1, 'not TOML: quotes must be straight: "')),
        ('a = 1\nb = "c\n', (2, "not TOML: the closing quote is missing")),
        ("[levels]\n[bus]\n[levels]\n", (3, "levels is written twice, first in line 1; keep one of them")),
    ],
)
def test_a_usual_slip_of_the_pen_is_named_in_the_words_of_a_config(text: str, expected: tuple[int, str]) -> None:
    assert faults(text) == [("", *expected)]


@pytest.mark.parametrize("text", ["", "[levels]\n", "finger = 3\n", "[finger]\n"])
def test_a_config_without_a_finger_is_refused(text: str) -> None:
    ((path, _, message),) = faults(text)
    assert path == "finger"
    assert re.match("is missing: each finger needs a table|must be a table", message)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("none.toml", "No such file"),
        (".", "Is a directory"),
        ("latin.toml", r"latin\.toml:2: cannot be read: it is not UTF-8 text"),
        ("marked.toml", "finger: is missing"),  # its byte-order mark is no fault
        ("/dev/zero", "must have at most 1000000 bytes"),
    ],
)
def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path, name: str, expected: str) -> None:
    (tmp_path / "latin.toml").write_bytes(b"#\n# \xe9\n")
    (tmp_path / "marked.toml").write_bytes(b"\xef\xbb\xbf[levels]\n")
    with pytest.raises(ConfigError, match=expected):
        config.load(tmp_path / name)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root becomes another user")
def test_a_config_of_root_alone_is_refused_to_the_user_of_the_service_with_the_remedy(tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text("", encoding="utf-8")
    file.chmod(0o600)
    os.seteuid(65534)
    try:
        with pytest.raises(ConfigError, match=r"cannot be read: Permission denied for user \w+; run chmod a\+r"):
            config.load(file)
    finally:
        os.seteuid(0)
