"""``slipd export --to lerobot``: the files that LeRobotDataset v3.0 reads, what is in them, and what is refused."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from replays import RECORDINGS

from slipd import cli
from slipd.errors import SlipdError
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay_dated
from slipd.tools.export import lerobot_dataset as module
from slipd.tools.export.export_command import EXPORT
from slipd.tools.export.frames import ACTION, LEVEL, STATE, Feature, FrameLayout
from slipd.tools.export.lerobot_dataset import lerobot_dataset
from slipd.tools.outputs import draft

parquet = pytest.importorskip("pyarrow.parquet")

RUN = RECORDINGS / "demo.mcap"


def export(*arguments: Path | str) -> int:
    return cli.main(["export", *map(str, arguments), "--to", "lerobot"])


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


def test_recordings_of_another_rig_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = RECORDINGS / "netft.mcap"
    assert export(RUN, other, tmp_path / "out", "--rate", "20") == 2
    error = capsys.readouterr().err
    assert error.startswith(
        f"slipd: {other}: its rig must have the features of {RUN}, because one data set has one rig; "
    )
    assert " it lacks " in error
    assert list(tmp_path.iterdir()) == []


LAYOUT = FrameLayout((Feature(STATE, ("x", "y")), Feature(LEVEL, ("left",), "int64"), Feature(ACTION, ("n",))), {}, {})


def write(folder: Path, lengths: list[int]) -> Path:
    """Write episodes of some lengths; the first number of the state counts the frames of all."""
    with lerobot_dataset(folder, LAYOUT, 50, "hold a box") as dataset:
        number = 0
        for episode, length in enumerate(lengths):
            for _ in range(length):
                dataset.add({STATE: np.array([number, math.nan]), LEVEL: np.array([episode]), ACTION: np.array([2.0])})
                number += 1
            dataset.end_episode(f"{episode}.mcap", 1000 + episode, "hold a box")
            assert (dataset.episodes, dataset.frames) == (episode + 1, number)
    return folder


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three episodes."""
    return write(tmp_path_factory.mktemp("written") / "set", [3, 9, 1])


def read_json(folder: Path, name: str) -> Any:
    return json.loads((folder / "meta" / name).read_text())


def test_frames_of_all_episodes_follow_each_other(written: Path) -> None:
    found = parquet.read_table(written / "data").to_pydict()
    assert all(math.isnan(y) for _, y in found[STATE])
    in_episode = [*range(3), *range(9), 0]
    assert {name: column for name, column in found.items() if name != STATE} == {
        LEVEL: [0] * 3 + [1] * 9 + [2],
        ACTION: [2.0] * 13,
        "timestamp": [np.float32(number / 50) for number in in_episode],
        "frame_index": in_episode,
        "episode_index": [0] * 3 + [1] * 9 + [2],
        "index": [x for x, _ in found[STATE]],
        "task_index": [0] * 13,
    }
    assert found["index"] == list(range(13))


def test_an_episode_has_its_place_its_origin_and_its_statistics(written: Path) -> None:
    episodes = parquet.read_table(written / "meta" / "episodes").to_pylist()
    places = [(each["dataset_from_index"], each["dataset_to_index"], each["length"]) for each in episodes]
    assert places == [(0, 3, 3), (3, 12, 9), (12, 13, 1)]
    assert (
        episodes[1]
        | {
            "episode_index": 1,
            "tasks": ["hold a box"],
            "recording": "1.mcap",
            "begin_unix_ns": 1001,
            f"stats/{STATE}/mean": [7.0, 0.0],
            "stats/index/max": [11.0],
            "stats/frame_index/count": [9],
        }
        == episodes[1]
    )


def test_the_meta_data_describe_every_feature(written: Path) -> None:
    info, stats = read_json(written, "info.json"), read_json(written, "stats.json")
    counts = {"total_episodes": 3, "total_frames": 13, "total_tasks": 1}
    assert info | {"codebase_version": "v3.0", "fps": 50, "splits": {"train": "0:3"}, **counts} == info
    assert info["features"] == info["features"] | {
        STATE: {"dtype": "float32", "shape": [2], "names": ["x", "y"]},
        "index": {"dtype": "int64", "shape": [1], "names": None},
    }
    schema = parquet.read_schema(written / "data" / "chunk-000" / "file-000.parquet")
    assert list(info["features"]) == list(stats) == schema.names
    types = [str(schema.field(name).type) for name in (STATE, LEVEL, ACTION, "timestamp")]
    assert types == ["fixed_size_list<element: float>[2]", "int64", "float", "float"]
    assert stats[STATE]["mean"] == pytest.approx([6.0, 0.0])
    tasks = parquet.read_table(written / "meta" / "tasks.parquet")
    assert tasks.to_pylist() == [{"task_index": 0, "task": "hold a box"}]
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]


@pytest.mark.parametrize("added", ["videos/front.mp4", "data/notes.txt", "meta/info.json"])
def test_a_data_set_to_which_something_was_added_is_never_replaced(added: str, tmp_path: Path, written: Path) -> None:
    out = shutil.copytree(written, tmp_path / "set")
    (out / added).parent.mkdir(exist_ok=True)
    (out / added).write_text("{}")
    with pytest.raises(
        SlipdError, match=r"is a folder that also holds '.*', and is not overwritten; give another name"
    ):
        draft(out, EXPORT, overwrite=True).__enter__()


def test_a_full_file_is_followed_by_another_and_full_folders_likewise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "FILE_MB", 0)
    monkeypatch.setattr(module, "FILES_OF_CHUNK", 2)
    written = write(tmp_path / "set", [3, 9, 1])
    episodes = parquet.read_table(written / "meta" / "episodes").to_pylist()
    assert [(each["data/chunk_index"], each["data/file_index"]) for each in episodes] == [(0, 0), (0, 1), (1, 0)]
    for each in episodes:
        path = module.DATA_PATH.format(chunk_index=each["data/chunk_index"], file_index=each["data/file_index"])
        assert parquet.read_table(written / path).num_rows == each["length"]
