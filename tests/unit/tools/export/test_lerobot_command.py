"""``slipd export --to lerobot`` as a person calls it: results, refusals, damaged recordings."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from replays import RECORDINGS

from slipd import cli
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


def test_recordings_of_another_rig_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = RECORDINGS / "netft.mcap"
    assert export(RUN, other, tmp_path / "out", "--rate", "20") == 2
    error = capsys.readouterr().err
    assert error.startswith(
        f"slipd: {other}: its rig must have the features of {RUN}, because one data set has one rig; "
    )
    assert " it lacks " in error
    assert names(tmp_path) == []
