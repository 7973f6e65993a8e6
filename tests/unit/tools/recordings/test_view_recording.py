"""What the page of a recording gets, and which recordings cannot be shown."""

from __future__ import annotations

import gzip
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
from slipd.tools.recordings.view_recording import RecordingView

DEMO = DATA / "replays" / "demo.mcap"


Show = Callable[[Path], RecordingView]


@pytest.fixture
def shown() -> Iterator[Show]:
    """Replay a whole recording in this thread."""
    views: list[RecordingView] = []

    def show(path: Path) -> RecordingView:
        recording = open_recording(path)
        views.append(RecordingView(recording))
        views[-1].replay()
        return views[-1]

    yield show
    for view in views:
        view.blocks.close()


def data_of(view: RecordingView, path: str) -> Any:
    answer = view.answer(path)
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


@pytest.mark.parametrize("kind", ["missing", "text", "folder", "empty"])
def test_a_file_that_is_no_recording_is_an_error_that_names_it(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"{kind}.mcap"
    if kind == "folder":
        path.mkdir()
    elif kind != "missing":
        path.write_text("no recording\n" if kind == "text" else "")
    assert cli.main(["view", str(path), "--listen", "127.0.0.1:0"]) == (2 if kind == "missing" else 1)
    assert str(path) in capsys.readouterr().err


def test_a_port_in_use_is_an_error_that_names_another(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(DATA / "replays" / "bota.mcap", tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        where = f"127.0.0.1:{taken.getsockname()[1]}"
        assert cli.main(["view", str(tmp_path / "bota.mcap"), "--listen", where]) == 1
    assert "--listen 127.0.0.1:0 takes any free port" in capsys.readouterr().err
