"""The zero of the pads from the first rows of a trial, in which the fingers are open."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from grip_trials import ZERO, write_trial
from project import CONFIG, TRIAL

from slipd import config
from slipd.errors import RecordingError
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd.tools.recordings.grips_import import import_trial

SHIPPED = (CONFIG / "grips.toml").read_text(encoding="utf-8")
OPEN = 40


def grasp(open_rows: int, held: float = 20_000.0, after: float = 20_000.0) -> np.ndarray[Any, Any]:
    """Normal load of each row: open, closing for 5 rows, held, and half a second more with another load."""
    return np.concatenate([np.zeros(open_rows), np.linspace(0.0, held, 5), np.full(40, held), np.full(20, after)])


def imported(tmp_path: Path, normal: np.ndarray[Any, Any], rows: int | None, text: str = SHIPPED) -> Path:
    out = tmp_path / "out.mcap"
    write_trial(tmp_path / "trial", normal, 0.1 * normal)
    import_trial(tmp_path / "trial", out, text, rows)
    return out


def test_the_zero_is_the_mean_of_the_first_rows(tmp_path: Path) -> None:
    text = open_recording(imported(tmp_path, grasp(OPEN), OPEN)).config_text
    for name, sensor in (("left", "1"), ("right", "2")):
        counts = np.loadtxt(tmp_path / "trial" / f"xela_sensor{sensor}.csv", delimiter=",", skiprows=1)
        np.testing.assert_allclose(config.parse(text, "").finger[name].pad.tare, counts[:OPEN].mean(axis=0), atol=0.051)


def test_nothing_else_of_the_config_changes(tmp_path: Path) -> None:
    text = open_recording(imported(tmp_path, grasp(OPEN), OPEN)).config_text
    trees = [tomllib.loads(one) for one in (SHIPPED, text)]
    for tree in trees:
        for finger in tree["finger"].values():
            assert len(finger["pad"].pop("tare")) == 48
    assert trees[0] == trees[1]
    assert "No other trial shows the pads unloaded" not in text, "the comment was about the old values"


def test_the_replay_needs_nothing_else(tmp_path: Path) -> None:
    """With the tare of the shipped config, which is of other pads, the open fingers read loads."""
    (tmp_path / "other").mkdir()
    other, tared = imported(tmp_path / "other", grasp(OPEN), None), imported(tmp_path, grasp(OPEN), OPEN)
    found = {
        out: [body for topic, body in replay(open_recording(out)) if topic == "slip.left"] for out in (other, tared)
    }
    assert found[other][5]["level"] != "no_contact"
    assert found[tared][5]["level"] == "no_contact"
    held = [body["normal_n"] for body in found[tared] if body["level"] == "stable"]
    assert np.median(held) == pytest.approx(20_000.0, rel=0.01)


@pytest.mark.parametrize("rows", [-1, 0, 4, 106])
def test_the_number_of_rows_is_checked(tmp_path: Path, rows: int) -> None:
    with pytest.raises(
        RecordingError, match=f"trial: tare-rows must be from 5 to 105, the rows of the trial, got {rows}"
    ):
        imported(tmp_path, grasp(OPEN), rows)
    assert not (tmp_path / "out.mcap").exists()


@pytest.mark.parametrize("rows", [OPEN + 2, OPEN + 5, 105])
def test_rows_in_which_the_fingers_close_are_refused(tmp_path: Path, rows: int) -> None:
    said = f"finger left, sensor 1: must be at rest in the first {rows} rows, within 250 of their mean"
    with pytest.raises(RecordingError, match=said):
        imported(tmp_path, grasp(OPEN), rows)


def test_rows_in_which_the_object_is_held_already_are_refused(tmp_path: Path) -> None:
    loads = np.concatenate([np.full(OPEN, 20_000.0), np.zeros(30)])
    said = r"finger left, sensor 1: must be unloaded .* a pull of 2\.00\d?e\+04 in row \d+: it was pressed at first"
    with pytest.raises(RecordingError, match=said):
        imported(tmp_path, loads, OPEN)


def test_the_shipped_trial_begins_in_the_grasp(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="must be unloaded in the first 20 rows"):
        import_trial(TRIAL, tmp_path / "out.mcap", SHIPPED, 20)


def test_a_wrong_sign_of_the_normal_axis_is_found(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="or axis_scale has a wrong sign"):
        imported(tmp_path, grasp(OPEN), OPEN, SHIPPED.replace("[1.0, 1.0, -1.0]", "[1.0, 1.0, 1.0]"))


def test_a_config_without_a_tare_gets_one(tmp_path: Path) -> None:
    head, _, tail = SHIPPED.partition("tare = [")
    text = head + tail[tail.index("\n]\n") + 3 :]
    tared = open_recording(imported(tmp_path, grasp(OPEN), OPEN, text)).config_text
    np.testing.assert_allclose(config.parse(tared, "").finger["left"].pad.tare, ZERO, atol=3.0)


def test_a_pad_in_one_line_is_refused(tmp_path: Path, two_pads: str) -> None:
    pads = tomllib.loads(two_pads.replace("0.001]", "-0.001]"))["finger"]
    keys = {name: [f"{key} = {value!r}" for key, value in finger["pad"].items()] for name, finger in pads.items()}
    lines = [f"[finger.{name}]\npad = {{{', '.join(pad)}}}" for name, pad in keys.items()]
    with pytest.raises(RecordingError, match=r"must have a line \[finger\.left\.pad\], to set tare below it"):
        imported(tmp_path, grasp(OPEN), OPEN, "\n".join(lines).replace("'", '"'))
