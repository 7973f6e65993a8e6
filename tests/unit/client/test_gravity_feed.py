from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from slipd_client import gravity_feed
from slipd_client.errors import CallError, RequestRefused
from slipd_client.gravity_feed import gravity_of
from slipd_client.grip import GripClient
from slipd_client.slipctl import main

if TYPE_CHECKING:
    from conftest import Daemon

HALF = 0.5**0.5
PATIENCE_S = 60.0
REPLY = {"gravity": "compensated"}


@pytest.fixture
def vectors(daemon: Daemon) -> list[list[float]]:
    """The vectors that the daemon was sent."""
    sent: list[list[float]] = []

    def answer(request: dict[str, Any]) -> dict[str, Any]:
        sent.append(request["gravity_mps2"])
        return REPLY

    daemon.handlers["gravity.set"] = answer
    return sent


@pytest.mark.parametrize(
    ("quaternion", "gravity"),
    [
        ((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, -1.0)),
        ((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        ((HALF, 0.0, 0.0, HALF), (0.0, -1.0, 0.0)),
        ((0.0, HALF, 0.0, HALF), (1.0, 0.0, 0.0)),
        ((0.0, 0.0, HALF, HALF), (0.0, 0.0, -1.0)),
    ],
)
def test_the_orientation_of_the_pad_gives_gravity_in_its_frame(
    quaternion: tuple[float, ...], gravity: tuple[float, ...]
) -> None:
    assert [component / gravity_feed.STANDARD_GRAVITY_MPS2 for component in gravity_of(quaternion)] == pytest.approx(
        gravity, abs=1e-12
    )


def test_one_orientation_is_sent_once_or_repeated(
    daemon: Daemon,
    vectors: list[list[float]],
    capsys: pytest.CaptureFixture[str],
    stepped: Callable[[Any], None],
) -> None:
    stepped(gravity_feed)
    assert main(["--requests", daemon.endpoint, "gravity", "left", "0", "0", "-9.81"]) == 0
    assert vectors == [[0.0, 0.0, -9.81]]
    assert capsys.readouterr().out == 'gravity: "compensated"\n'
    assert main(["--requests", daemon.endpoint, "gravity", "left", "0", "0", "0", "1", "--hold", "0.35"]) == 0
    assert vectors[1:] == [[0.0, 0.0, -9.80665]] * 5


def test_every_line_of_a_pipe_is_followed_until_it_ends(
    daemon: Daemon, vectors: list[list[float]], tmp_path: Path
) -> None:
    pipe = tmp_path / "poses"
    os.mkfifo(pipe)

    def write() -> None:
        with pipe.open("w") as out:
            for line, sent in (("1 0 0\n", [1.0, 0.0, 0.0]), ("# comment\n", None), ("0 1 0", None)):
                out.write(line)
                out.flush()
                until_s = time.monotonic() + PATIENCE_S
                while sent is not None and sent not in list(vectors) and time.monotonic() < until_s:
                    time.sleep(0.01)

    writer = threading.Thread(target=write)
    writer.start()
    assert main(["--requests", daemon.endpoint, "gravity", "left", "--follow", str(pipe), "--hold", "0"]) == 0
    writer.join()
    assert vectors[0] == [1.0, 0.0, 0.0]
    assert vectors[-1] == [0.0, 1.0, 0.0]


def test_a_file_is_followed_from_its_last_line_and_an_old_line_is_not_repeated_for_ever(
    daemon: Daemon, vectors: list[list[float]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gravity_feed, "FOLLOW_S", 0.2)
    file = tmp_path / "poses"
    file.write_text("1 0 0\n0 0 1\n")
    with GripClient(daemon.endpoint) as client:
        sleeps = 0
        sleep = time.sleep

        def write_more(seconds: float) -> None:
            nonlocal sleeps
            sleeps += 1
            sleep(seconds)
            if sleeps == 6:
                known.append(len(vectors))
            if sleeps == 8:
                known.append(len(vectors))
                with file.open("a") as more:
                    more.write("0 1 0\n")
            if sleeps == 9:
                with file.open("a") as more:
                    more.write("bad\n")

        known: list[int] = []
        monkeypatch.setattr(gravity_feed.time, "sleep", write_more)
        with pytest.raises(CallError, match="got 'bad'"):
            gravity_feed.follow(client, "left", str(file), None)
    assert vectors[0] == [0.0, 0.0, 1.0]
    assert known[0] == known[1], "the line was repeated for longer than its time"
    assert vectors[-1] == [0.0, 1.0, 0.0]


def test_a_refusal_ends_it_with_the_reason_of_the_daemon(daemon: Daemon) -> None:
    error = {"error": {"code": "bad_value", "message": "must be one of left, right", "field": "finger"}}
    daemon.handlers["gravity.set"] = lambda _: error
    with GripClient(daemon.endpoint) as client, pytest.raises(RequestRefused, match="left, right"):
        gravity_feed.send(client, "thumb", [0.0, 0.0, -9.8], 1.0)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["left"], "gravity needs either three or four numbers, or --follow FILE"),
        (["left", "1", "2"], "must be three numbers"),
        (["left", "1", "0", "0", "1"], "must be a unit quaternion in the order x y z w, got one of length 1.414"),
        (["left", "1", "2", "inf"], "must be finite"),
        (["left", "0", "0", "1", "--hold", "-1"], "--hold"),
        (["left", "--follow", "/nowhere/at/all"], "--follow must name a file or pipe that can be read"),
    ],
)
def test_a_wrong_call_exits_with_2_and_a_reason(
    daemon: Daemon, arguments: list[str], complaint: str, call: Callable[..., tuple[int, str, str]]
) -> None:
    code, _, errors = call("--requests", daemon.endpoint, "gravity", *arguments)
    assert code == 2
    assert complaint in errors
