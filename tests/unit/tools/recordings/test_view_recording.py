"""What the page of a recording gets, in frames and blocks, and which recordings cannot be shown."""

from __future__ import annotations

import gzip
import itertools
import json
import shutil
import socket
from pathlib import Path
from typing import Any

import pytest
from altered_recordings import lossy
from nanoseconds import MS
from project import DATA

from slipd import cli
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd.tools.recordings.replay_commands import FRAME_NS, RecordedBlocks, RecordingView

DEMO = DATA / "replays" / "demo.mcap"


def shown(path: Path) -> RecordingView:
    """Replay a whole recording in this thread."""
    view = RecordingView(open_recording(path))
    view.replay()
    return view


def data_of(view: RecordingView, path: str) -> Any:
    answer: Any = view.answer(path)
    packed = answer.headers.get("Content-Encoding") == "gzip"
    return json.loads(gzip.decompress(answer.body) if packed else answer.body)


def test_the_page_gets_the_messages_of_the_replay() -> None:
    view = shown(DEMO)
    published = list(replay(open_recording(DEMO)))
    state = data_of(view, "/data/recording/0")
    assert (state["ended"], state["fault"], state["gaps"]) == (True, "", [])
    assert state["changes"] == [body for topic, body in published if topic == "warning"]
    frames = [frame for number in range(4) for frame in data_of(view, f"/data/block/{number}")]
    known = {(topic, body["seq"]): body for topic, body in published}
    assert all(known[topic, body["seq"]] == body for frame in frames for topic, body in frame["topics"].items())
    assert {"slip.left", "tactile.right", "grasp", "gripper", "status"} <= {
        topic for frame in frames for topic in frame["topics"]
    }


def test_the_page_learns_where_nothing_was_recorded_and_of_the_fault(tmp_path: Path) -> None:
    begin_ns = next(open_recording(DEMO).events())[0]
    state = data_of(shown(lossy(DEMO, tmp_path)), "/data/recording/0")
    assert state["gaps"] == [pytest.approx([begin_ns + 1e9, begin_ns + 2e9], abs=2e7)]
    assert "entries were lost while recording" in state["fault"]


@pytest.mark.parametrize("path", ["/data/", "/data/block/-1", "/data/block/x", "/data/other/0", "/data/block/0/1"])
def test_there_is_nothing_else(path: str) -> None:
    assert RecordingView(open_recording(DEMO)).answer(path) is None


def test_a_port_in_use_is_an_error_that_names_another(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(DATA / "replays" / "bota.mcap", tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        where = f"127.0.0.1:{taken.getsockname()[1]}"
        assert cli.main(["view", str(tmp_path / "bota.mcap"), "--listen", where]) == 2
    assert "--listen 127.0.0.1:0 takes any free port" in capsys.readouterr().err


BEGIN_NS = 5_000 * MS


def frames(blocks: RecordedBlocks, number: int) -> Any:
    return json.loads(gzip.decompress(blocks.block(number)))  # type: ignore[arg-type]


def filled(*messages: tuple[str, float]) -> RecordedBlocks:
    """Return what there is of messages, each a topic and a time, ms; ``seq`` is that time."""
    blocks = RecordedBlocks()
    for topic, at_ms in messages:
        blocks.add(topic, {"t_ns": BEGIN_NS + round(at_ms * MS), "seq": at_ms})
    blocks.end()
    return blocks


def test_frames_are_as_far_apart_as_a_page_can_draw() -> None:
    found = frames(filled(*(("slip.left", at_ms) for at_ms in range(0, 1000, 4))), 0)
    times = [frame["now_ns"] for frame in found]
    assert len(times) == 28
    assert all(later - earlier >= FRAME_NS - 4 * MS for earlier, later in itertools.pairwise(times[:-1]))
    assert found[-1]["topics"]["slip.left"]["seq"] == 996


def test_a_frame_has_the_newest_message_and_the_first_of_a_block_every_topic() -> None:
    blocks = filled(("status", 0), ("grasp", 0), *(("slip.left", at_ms) for at_ms in range(0, 2000, 10)))
    first, second = frames(blocks, 0), frames(blocks, 1)
    assert first[0]["topics"].keys() == second[0]["topics"].keys() == {"status", "grasp", "slip.left"}
    assert all(frame["topics"].keys() == {"slip.left"} for frame in first[1:] + second[1:])
    assert all(frame["topics"]["slip.left"]["t_ns"] == frame["now_ns"] for frame in first + second)


def test_time_never_runs_back_and_a_pause_has_no_blocks() -> None:
    blocks = filled(*(("slip.left", at_ms) for at_ms in (0, 100, 40, 200, 3500, 3400, 3600)))
    times = [frame["now_ns"] for number in (0, 3) for frame in frames(blocks, number)]
    assert times == sorted(times)
    assert blocks.block(1) is blocks.block(2) is blocks.block(4) is None
    assert blocks.seconds == pytest.approx(3.6)


def test_nothing_recorded_is_nothing_shown() -> None:
    blocks = filled()
    assert (blocks.begin_ns, blocks.seconds, blocks.ended, blocks.block(0)) == (None, 0.0, True, None)
