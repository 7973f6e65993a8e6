"""What the page of a recording gets, in frames and blocks, and which recordings cannot be shown."""

from __future__ import annotations

import gzip
import itertools
import json
import shutil
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from lossy_recording import lossy
from project import DATA

from slipd import cli
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd.tools.recordings.view_recording import FRAME_NS, RecordedBlocks, RecordingView

DEMO = DATA / "replays" / "demo.mcap"


Show = Callable[[Path], RecordingView]


@pytest.fixture
def shown() -> Iterator[Show]:
    """Replay a whole recording in this thread."""
    views: list[RecordingView] = []

    def show(path: Path) -> RecordingView:
        views.append(RecordingView(open_recording(path)))
        views[-1].replay()
        return views[-1]

    yield show
    for view in views:
        view.blocks.close()


def data_of(view: RecordingView, path: str) -> Any:
    answer: Any = view.answer(path)
    packed = answer.headers.get("Content-Encoding") == "gzip"
    return json.loads(gzip.decompress(answer.body) if packed else answer.body)


def test_the_page_gets_the_messages_of_the_replay(shown: Show) -> None:
    view = shown(DEMO)
    published = list(replay(open_recording(DEMO)))
    state = data_of(view, "/data/recording/0")
    assert (state["ended"], state["fault"]) == (True, "")
    assert state["changes"] == [body for topic, body in published if topic == "warning"]
    assert state["gaps"] == []
    frames = [frame for number in range(4) for frame in data_of(view, f"/data/block/{number}")]
    known = {(topic, body["seq"]): body for topic, body in published}
    for frame in frames:
        assert all(known[topic, body["seq"]] == body for topic, body in frame["topics"].items())
    assert {"slip.left", "tactile.right", "grasp", "gripper", "status"} <= {
        topic for frame in frames for topic in frame["topics"]
    }


def test_the_page_learns_where_nothing_was_recorded(shown: Show, tmp_path: Path) -> None:
    begin_ns = next(open_recording(DEMO).events())[0]
    ((gap_begin_ns, gap_end_ns),) = data_of(shown(lossy(DEMO, tmp_path)), "/data/recording/0")["gaps"]
    assert gap_begin_ns - begin_ns == pytest.approx(1e9, abs=2e7)
    assert gap_end_ns - begin_ns == pytest.approx(2e9, abs=2e7)


@pytest.mark.parametrize("path", ["/data/", "/data/block/-1", "/data/block/x", "/data/other/0", "/data/block/0/1"])
def test_there_is_nothing_else(path: str, shown: Show) -> None:
    assert shown(DATA / "replays" / "bota.mcap").answer(path) is None


def test_a_recording_that_was_cut_off_is_shown_with_the_fault(tmp_path: Path, shown: Show) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(DEMO.read_bytes()[: DEMO.stat().st_size // 2])
    assert "cut.mcap" in data_of(shown(cut), "/data/recording/0")["fault"]


def test_a_port_in_use_is_an_error_that_names_another(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(DATA / "replays" / "bota.mcap", tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        where = f"127.0.0.1:{taken.getsockname()[1]}"
        assert cli.main(["view", str(tmp_path / "bota.mcap"), "--listen", where]) == 1
    assert "--listen 127.0.0.1:0 takes any free port" in capsys.readouterr().err


MS = 1_000_000
BEGIN_NS = 5_000 * MS


@pytest.fixture
def blocks() -> Iterator[RecordedBlocks]:
    blocks = RecordedBlocks()
    yield blocks
    blocks.close()


def frames(blocks: RecordedBlocks, number: int) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(gzip.decompress(blocks.block(number)))  # type: ignore[arg-type]
    return found


def add(blocks: RecordedBlocks, topic: str, at_ms: float, **fields: Any) -> None:
    blocks.add(topic, {"t_ns": BEGIN_NS + round(at_ms * MS)} | fields)


def test_frames_are_as_far_apart_as_a_page_can_draw(blocks: RecordedBlocks) -> None:
    for at_ms in range(0, 1000, 4):
        add(blocks, "slip.left", at_ms, seq=at_ms)
    blocks.end()
    times = [frame["now_ns"] for frame in frames(blocks, 0)]
    assert len(times) == 28
    assert all(later - earlier >= FRAME_NS - 4 * MS for earlier, later in itertools.pairwise(times[:-1]))
    assert frames(blocks, 0)[-1]["topics"]["slip.left"]["seq"] == 996


def test_a_frame_has_the_newest_message_and_the_first_of_a_block_every_topic(blocks: RecordedBlocks) -> None:
    add(blocks, "status", 0, seq=1)
    add(blocks, "grasp", 0, seq=1)
    for at_ms in range(0, 2000, 10):
        add(blocks, "slip.left", at_ms, seq=at_ms)
    blocks.end()
    first, second = frames(blocks, 0), frames(blocks, 1)
    assert first[0]["topics"].keys() == second[0]["topics"].keys() == {"status", "grasp", "slip.left"}
    assert all(frame["topics"].keys() == {"slip.left"} for frame in first[1:] + second[1:])
    assert all(frame["topics"]["slip.left"]["t_ns"] == frame["now_ns"] for frame in first + second)


def test_time_never_runs_back_and_a_pause_has_no_blocks(blocks: RecordedBlocks) -> None:
    for at_ms in (0, 100, 40, 200, 3500, 3400, 3600):
        add(blocks, "slip.left", at_ms)
    blocks.end()
    times = [frame["now_ns"] for number in (0, 3) for frame in frames(blocks, number)]
    assert times == sorted(times)
    assert blocks.block(1) is blocks.block(2) is blocks.block(4) is None
    assert blocks.seconds == pytest.approx(3.6)


def test_nothing_recorded_is_nothing_shown(blocks: RecordedBlocks) -> None:
    blocks.end()
    assert (blocks.begin_ns, blocks.seconds, blocks.ended, blocks.block(0)) == (None, 0.0, True, None)
