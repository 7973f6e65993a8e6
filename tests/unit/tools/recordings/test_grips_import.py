"""Trials become recordings of live runs, with the zero of the pads from rows in which the fingers are open."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from grip_trials import write_trial
from project import CONFIG, TRIAL
from recorded_entries import TWO_PADS

from slipd.cli import main
from slipd.devices.xela import Decoder
from slipd.errors import RecordingError
from slipd.events import Bytes, LinkUp, Tick
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd.tools.recordings.grips_import import import_trial

LAST_NS = 5_751_000_000


def test_a_trial_becomes_the_events_of_a_live_run(tmp_path: Path) -> None:
    import_trial(TRIAL, tmp_path / "out.mcap", TWO_PADS)
    recording = open_recording(tmp_path / "out.mcap")
    events = list(recording.events())
    assert (recording.complete, recording.config_text, list(recording.messages())) == (True, TWO_PADS, [])
    assert events[:2] == [
        (1_000_000_000, LinkUp("left.pad", "ws://127.0.0.1:5000")),
        (1_000_000_000, Bytes("left.pad", b'{"message":"Welcome"}')),
    ]
    times_ns = [t_ns for t_ns, _ in events]
    assert times_ns == sorted(times_ns)
    assert [t_ns for t_ns, event in events if isinstance(event, Tick)] == list(
        range(1_000_000_000, LAST_NS + 500_000_000, 10_000_000)
    )


def test_the_decoder_reads_every_count_of_every_row_at_its_time(tmp_path: Path) -> None:
    import_trial(TRIAL, tmp_path / "out.mcap", TWO_PADS)
    decoder = Decoder()
    samples = [
        sample
        for t_ns, event in open_recording(tmp_path / "out.mcap").events()
        if isinstance(event, Bytes)
        for sample in decoder.receive(event.data, t_ns)
    ]
    assert (decoder.health.bad, decoder.health.lost, decoder.health.bad_bytes) == (0, 0, 0)
    times_s = np.loadtxt(TRIAL / "robot_state.csv", skiprows=1)
    for key, name in (("1", "xela_sensor1.csv"), ("2", "xela_sensor2.csv")):
        of_pad = [sample for sample in samples if sample.source == key]
        counts = np.loadtxt(TRIAL / name, delimiter=",", skiprows=1)
        np.testing.assert_array_equal([sample.values.ravel() for sample in of_pad], counts)
        np.testing.assert_allclose([sample.t_ns / 1e9 - 1.0 for sample in of_pad], times_s, atol=1e-9)
        assert [sample.device_time_ns for sample in of_pad] == [sample.t_ns for sample in of_pad]


def replaced(line: int, column: int, cell: str) -> Callable[[Path], object]:
    """Replace one cell; lines count from 1, columns from 0."""

    def damage(path: Path) -> None:
        rows = [row.split(",") for row in path.read_text().splitlines()]
        rows[line - 1][column] = cell
        path.write_text("\n".join(map(",".join, rows)))

    return damage


def cut(characters: int, lines: int = 0) -> Callable[[Path], object]:
    def damage(path: Path) -> None:
        path.write_text("\n".join(path.read_text()[: -characters or None].splitlines()[: -lines or None]))

    return damage


COUNT = ":17: txl2_y must be an integer from 0 to 65535"
NO_NUMBERS = ": must be a table of numbers in CSV: "
DAMAGES: list[tuple[str, Callable[[Path], object], str]] = [
    *[
        (name, Path.unlink, ": cannot be read: No such file or directory")
        for name in ("xela_sensor1.csv", "xela_sensor2.csv", "robot_state.csv")
    ],
    *[
        ("xela_sensor2.csv", replaced(17, 4, cell), f"{COUNT}, got {float(cell):g}")
        for cell in ("1.5", "-1", "65536.0", "nan", "1e999")
    ],
    *[
        ("xela_sensor2.csv", replaced(17, 4, cell), f"{NO_NUMBERS}could not convert string '{cell}' to float64")
        for cell in ("high", "")
    ],
    ("xela_sensor1.csv", replaced(1, 5, "txl2_w"), ":1: must have one column 'txl2_z', got 0"),
    ("xela_sensor1.csv", replaced(1, 4, "txl2_x"), ":1: must have one column 'txl2_x', got 2"),
    ("xela_sensor1.csv", cut(30), f"{NO_NUMBERS}invalid column index 45 at row 285 with 45 columns"),
    ("xela_sensor2.csv", cut(0, lines=2), ": must have as many rows as robot_state.csv, 285, got 283"),
    ("robot_state.csv", replaced(50, 0, "0.001"), ":50: time must not decrease, got 0.001"),
    ("robot_state.csv", replaced(50, 0, "soon"), f"{NO_NUMBERS}could not convert string 'soon' to float64"),
    ("robot_state.csv", cut(0, lines=285), ": must have one row for each reading, got none"),
    (
        "robot_state.csv",
        replaced(50, 0, "4751"),
        ":50: time must be in seconds, within an hour of the first row, got 4751",
    ),
]


@pytest.mark.parametrize(("name", "damage", "error"), DAMAGES, ids=[f"{name}{error}" for name, _, error in DAMAGES])
def test_a_damaged_trial_is_refused_with_file_line_and_rule(
    tmp_path: Path, name: str, damage: Callable[[Path], object], error: str
) -> None:
    trial = Path(shutil.copytree(TRIAL, tmp_path / "trial"))
    damage(trial / name)
    with pytest.raises(RecordingError) as caught:
        import_trial(trial, tmp_path / "out.mcap", TWO_PADS)
    assert str(caught.value).startswith(f"{trial / name}{error}")
    assert list(tmp_path.iterdir()) == [trial]


@pytest.mark.parametrize(
    ("old", "new"), [('sensor = "2"', 'sensor = "3"'), ("ws://127.0.0.1:5000", "ws://127.0.0.1:5001")]
)
def test_a_config_with_other_sensors_or_addresses_is_refused(tmp_path: Path, old: str, new: str) -> None:
    head, tail = TWO_PADS.rsplit(old, 1)
    with pytest.raises(RecordingError, match="must have the xela sensors 1 and 2 at one address"):
        import_trial(TRIAL, tmp_path / "out.mcap", head + new + tail)
    assert list(tmp_path.iterdir()) == []


SHIPPED = (CONFIG / "grips.toml").read_text(encoding="utf-8")
OPEN = 40


def grasp(open_rows: int, held: float = 20_000.0, after: float = 20_000.0) -> np.ndarray[Any, Any]:
    """Normal load of each row: open, closing for 5 rows, held, and half a second more with another load."""
    return np.concatenate([np.zeros(open_rows), np.linspace(0.0, held, 5), np.full(40, held), np.full(20, after)])


def imported(tmp_path: Path, normal: np.ndarray[Any, Any], rows: int | None) -> Path:
    out = tmp_path / "out.mcap"
    write_trial(tmp_path / "trial", normal, 0.1 * normal)
    import_trial(tmp_path / "trial", out, SHIPPED, rows)
    return out


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


HELD = np.concatenate([np.full(OPEN, 20_000.0), np.zeros(30)])
AT_REST = r"finger left, sensor 1: must be at rest in the first \d+ rows, within 250 of their mean"


@pytest.mark.parametrize(
    ("rows", "error"),
    [
        *[(rows, rf"trial: tare-rows must be from 5 to 105, .*, got {rows}") for rows in (-1, 4, 106)],
        *[(rows, AT_REST) for rows in (OPEN + 2, OPEN + 5, 105)],
    ],
)
def test_rows_that_do_not_show_the_zero_are_refused(tmp_path: Path, rows: int, error: str) -> None:
    with pytest.raises(RecordingError, match=error):
        imported(tmp_path, grasp(OPEN), rows)
    assert not (tmp_path / "out.mcap").exists()


CROSSTALK = np.where(np.arange(105) == 60, -600.0, grasp(OPEN))


@pytest.mark.parametrize(
    ("normal", "text", "cause", "lasts"),
    [
        (HELD, SHIPPED, "is pressed in 0: it was pressed in the first rows, or axis_scale has a wrong sign", True),
        (grasp(OPEN), SHIPPED.replace("[1.0, 1.0, -1.0]", "[1.0, 1.0, 1.0]"), "or axis_scale has a wrong sign", True),
        (CROSSTALK, SHIPPED, "reads a pull in 1 rows, of up to 6", False),
    ],
)
def test_a_pull_is_reported_and_left_to_the_run(
    tmp_path: Path, normal: np.ndarray[Any, Any], text: str, cause: str, lasts: bool
) -> None:
    write_trial(tmp_path / "trial", normal, 0.1 * np.abs(normal))
    found = import_trial(tmp_path / "trial", tmp_path / "out.mcap", text, OPEN)
    assert [line.split(",")[0] for line in found] == ["finger left", "finger left", "finger right", "finger right"]
    assert "zero from the first 40 rows, at rest within" in found[0]
    assert cause in found[1]
    slips = [body for topic, body in replay(open_recording(tmp_path / "out.mcap")) if topic == "slip.left"]
    assert ("pulled" in {reason for body in slips for reason in body["reasons"]}) == lasts
    assert "slipping" not in {body["level"] for body in slips}


def test_the_command_prints_what_the_tare_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_trial(tmp_path / "trial", grasp(OPEN), 0.1 * grasp(OPEN))
    assert main(["import", "grips", str(tmp_path / "trial"), str(tmp_path / "out.mcap"), "--tare-rows", "10"]) == 0
    assert "finger right, sensor 2: zero from the first 10 rows, at rest within" in capsys.readouterr().out
