"""``slipd export --to lerobot`` as a person calls it: results, refusals, damaged recordings."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from replays import RECORDINGS

from slipd import cli
from slipd.recording.mcap_file import RecordingFile
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay_dated
from slipd.tools.export.frames import ACTION, LEVEL, STATE

parquet = pytest.importorskip("pyarrow.parquet")

RUN = RECORDINGS / "demo.mcap"


def export(*arguments: Path | str) -> int:
    return cli.main(["export", *map(str, arguments), "--to", "lerobot"])


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings of one rig at 50 Hz."""
    folder = tmp_path_factory.mktemp("dataset")
    (folder / "runs").mkdir()
    for name in ("a.mcap", "b.mcap"):
        shutil.copy(RUN, folder / "runs" / name)
    assert export(folder / "runs", folder / "set", "--rate", "50", "--task", "lift the box") == 0
    return folder / "set"


def test_frames_have_the_newest_messages_of_the_replay(dataset: Path) -> None:
    recording = open_recording(RUN)
    messages = list(replay_dated(recording))
    begin_ns = messages[0][0]
    table = parquet.read_table(dataset / "data").to_pydict()
    episodes = parquet.read_table(dataset / "meta" / "episodes").to_pylist()
    assert [each["recording"] for each in episodes] == ["a.mcap", "b.mcap"]
    assert [each["begin_unix_ns"] for each in episodes] == [begin_ns + recording.wall_minus_monotonic_ns] * 2
    for frame in (0, 7, 60, 150, episodes[0]["length"] - 1):
        until_ns = begin_ns + frame * 20_000_000
        newest = {topic: body for t_ns, topic, body in messages if t_ns <= until_ns}
        for index in (frame, frame + episodes[0]["length"]):
            force_n = newest.get("wrench.left", {}).get("force_n") or [np.nan] * 3
            np.testing.assert_array_equal(table[STATE][index][:3], np.float32(force_n))
            assert table[LEVEL][index][0] == newest.get("slip.left", {"level_code": 5})["level_code"]
            commanded_n = newest.get("gripper", {}).get("force_command_n")
            np.testing.assert_array_equal(
                table[ACTION][index], np.float32(np.nan if commanded_n is None else commanded_n)
            )
    assert json.loads((dataset / "meta" / "info.json").read_text())["robot_type"] == "slipd"


@pytest.mark.parametrize("added", ["videos/front.mp4", "data/notes.txt", "meta/info.json"])
def test_a_data_set_to_which_something_was_added_is_never_replaced(
    added: str, tmp_path: Path, dataset: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "set"
    shutil.copytree(dataset, out)
    (out / added).parent.mkdir(exist_ok=True)
    (out / added).write_text("{}")
    assert export(RUN, out, "--rate", "10", "--overwrite") == 2
    error = capsys.readouterr().err
    assert error.startswith(f"slipd: {out}: is a folder that also holds '")
    assert error.endswith("', and is not overwritten; give another name\n")
    assert (out / added).read_text() == "{}"


def test_a_folder_of_exports_is_never_replaced(tmp_path: Path, dataset: Path) -> None:
    shutil.copytree(dataset, tmp_path / "sets" / "first")
    assert export(RUN, tmp_path / "sets", "--rate", "10", "--overwrite") == 2
    assert names(tmp_path / "sets") == ["first"]


def test_a_truncated_recording_is_an_episode_up_to_its_end_and_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    half = tmp_path / "half.mcap"
    half.write_bytes(RUN.read_bytes()[: RUN.stat().st_size * 3 // 4])
    assert export(half, RUN, tmp_path / "out", "--rate", "20") == 1
    shown = capsys.readouterr()
    assert shown.out.endswith(" frames of 2 episodes\n")
    assert shown.err.startswith(f"slipd: the export is incomplete: {half}: was cut off in the record at byte ")
    first, second = parquet.read_table(tmp_path / "out" / "meta" / "episodes").to_pylist()
    assert 0 < first["length"] < second["length"]


def test_bytes_of_a_name_that_are_no_text_are_escaped(tmp_path: Path) -> None:
    run = Path(os.fsdecode(bytes(tmp_path) + b"/run\xff.mcap"))
    shutil.copy(RUN, run)
    assert export(run, tmp_path / "out", "--rate", "1") == 0
    (episode,) = parquet.read_table(tmp_path / "out" / "meta" / "episodes").to_pylist()
    assert episode["recording"] == "run\\xff.mcap"


def test_recordings_of_another_rig_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = RECORDINGS / "netft.mcap"
    assert export(RUN, other, tmp_path / "out", "--rate", "20") == 2
    error = capsys.readouterr().err
    assert error.startswith(
        f"slipd: {other}: its rig must have the features of {RUN}, because one data set has one rig; "
    )
    assert " it lacks " in error
    assert names(tmp_path) == []


def test_what_is_no_recording_or_has_no_message_is_refused(
    tmp_path: Path, rig: str, capsys: pytest.CaptureFixture[str]
) -> None:
    text, empty = tmp_path / "run.mcap", tmp_path / "empty.mcap"
    text.write_text("time,force\n")
    recording = RecordingFile(empty, config_text=rig, boot="b", wall_minus_monotonic_ns=0)
    recording.finish(0)
    recording.close()
    for file, error in (
        (text, "not an MCAP file, and so not a recording of slipd"),
        (empty, "holds no event that causes a message"),
        (tmp_path / "none.mcap", "cannot be opened: No such file or directory"),
    ):
        assert export(file, tmp_path / "out", "--rate", "20") == (1 if file.exists() else 2)
        assert f"{file}: {error}" in capsys.readouterr().err
    (tmp_path / "folder").mkdir()
    assert export(tmp_path / "folder", tmp_path / "out", "--rate", "20") == 2
    assert "no recording (*.mcap) in this folder" in capsys.readouterr().err
    assert names(tmp_path) == ["empty.mcap", "folder", "run.mcap"]


@pytest.mark.parametrize("rate", ["0", "-5", "2.5", "fast", "1001", "nan", ""])
def test_a_rate_is_an_integer_in_its_range(rate: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        export("a.mcap", "out", f"--rate={rate}")
    assert f"argument --rate: must be an integer from 1 to 1000, got {rate!r}" in capsys.readouterr().err


def test_options_go_with_their_format(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    for arguments, error in (
        ([RUN, out, "--to", "lerobot"], "--to lerobot needs --rate HZ, the frames per second"),
        (
            [RUN, out, "--to", "csv", "--rate", "20"],
            "--rate is for --to lerobot; csv has every message at its own time",
        ),
        ([RUN, out, "--to", "csv", "--task", "x"], "--task is for --to lerobot; csv has every message at its own time"),
        ([RUN, RUN, out, "--to", "csv"], "--to csv takes one recording, got 2; --to lerobot takes several"),
    ):
        assert cli.main(["export", *map(str, arguments)]) == 2
        assert capsys.readouterr().err == f"slipd: {error}\n"
    with pytest.raises(SystemExit):
        export(RUN, out, "--rate", "20", "--task", " ")
    assert "argument --task: must be a sentence, got an empty text" in capsys.readouterr().err
