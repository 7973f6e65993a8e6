"""Gravity that a person or program passes on with slipctl: once, for some time, or line by line."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from client_peers import Daemon, refuse, until

from slipd_client import gravity_feed
from slipd_client.errors import CallError, RequestRefused
from slipd_client.gravity_feed import gravity_of
from slipd_client.grip import GripClient

Call = Callable[..., tuple[int, str, str]]

HALF = 0.5**0.5


def vectors(daemon: Daemon) -> list[list[float]]:
    """Return the vectors that the daemon was sent."""
    return [request["gravity_mps2"] for request in daemon.asked]


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
    assert gravity_of(quaternion) == pytest.approx([9.80665 * component for component in gravity], abs=1e-12)


def test_one_orientation_is_sent_once_or_repeated(daemon: Daemon, call: Call, stepped: Callable[[Any], None]) -> None:
    stepped(gravity_feed)
    daemon.handlers["gravity.set"] = lambda _: {"gravity": "compensated"}
    gravity = ("--requests", daemon.endpoint, "gravity", "left")
    assert call(*gravity, "0", "0", "-9.81") == (0, 'gravity: "compensated"\n', "")
    assert call(*gravity, "0", "0", "0", "1", "--hold", "0.35")[0] == 0
    daemon.handlers["gravity.set"] = lambda _: {"gravity": "none"}
    said = "slipctl: the config gives finger left no mass_kg: no weight is subtracted\n"
    assert call(*gravity, "1", "0", "0", "--hold", "0.15") == (0, 'gravity: "none"\n', said)
    assert vectors(daemon) == [[0.0, 0.0, -9.81], *[[0.0, 0.0, -9.80665]] * 4, *[[1.0, 0.0, 0.0]] * 2]


@pytest.mark.parametrize("hold", ["0", "0.2"])
def test_every_line_of_a_pipe_is_followed_until_it_ends(hold: str, daemon: Daemon, call: Call, tmp_path: Path) -> None:
    pipe = tmp_path / "poses"
    os.mkfifo(pipe)

    def write() -> None:
        with pipe.open("w", buffering=1) as out:
            out.write("1 0 0\n")
            until(lambda: vectors(daemon))
            out.write("# comment\n0 1 0")

    with ThreadPoolExecutor() as threads:
        writing = threads.submit(write)
        assert call("--requests", daemon.endpoint, "gravity", "left", "--follow", str(pipe), "--hold", hold)[0] == 0
        writing.result()
    assert [vectors(daemon)[0], vectors(daemon)[-1]] == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]


def test_a_file_is_followed_from_its_last_line_and_an_old_line_is_not_repeated_for_ever(
    daemon: Daemon, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, sleep, known = tmp_path / "poses", time.sleep, []
    file.write_text("1 0 0\n0 0 1\n")
    written = {8: "0 1 0\n", 9: "bad\n"}

    def write_more(seconds: float) -> None:
        sleep(seconds)
        known.append(vectors(daemon))
        with file.open("a") as more:
            more.write(written.get(len(known), ""))

    monkeypatch.setattr(gravity_feed.time, "sleep", write_more)
    with GripClient(daemon.endpoint) as client, pytest.raises(CallError, match="got 'bad'"):
        gravity_feed.send(client, "left", gravity_feed.followed(str(file)), 0.2)
    assert known[0][0] == [0.0, 0.0, 1.0]
    assert known[5] == known[7], "the line was repeated for longer than its time"
    assert vectors(daemon)[-1] == [0.0, 1.0, 0.0]


def test_a_refusal_ends_it_with_the_reason_of_the_daemon(daemon: Daemon) -> None:
    daemon.handlers["gravity.set"] = refuse("bad_value", "must be one of left, right", "finger")
    with GripClient(daemon.endpoint) as client, pytest.raises(RequestRefused, match="left, right"):
        gravity_feed.send(client, "thumb", iter([[[0.0, 0.0, -9.8]]]), 1.0)
