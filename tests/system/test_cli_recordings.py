"""The commands slipd import and slipd replay on a real trial: output and exit codes."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
import zmq
from project import TRIAL

from slipd.cli import main
from slipd_client.messages import MESSAGE_LIMITS, decode

START_S = 1.0  # where an imported trial begins
SLIPD = str(Path(sys.executable).with_name("slipd"))


@pytest.fixture
def recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """The trial in which the object is dropped, imported with the shipped config."""
    out = tmp_path / "trial.mcap"
    assert main(["import", "grips", str(TRIAL), str(out)]) == 0
    assert capsys.readouterr().out == f"{out}: written; replay it with: slipd replay {out} --speed max\n"
    return out


def drop_s() -> float:
    """Time of the drop: the first row with that label."""
    with (TRIAL / "slip_label.csv").open() as labels, (TRIAL / "robot_state.csv").open() as times:
        for label, row in zip(csv.DictReader(labels), csv.DictReader(times), strict=True):
            if float(label["fail"]):
                return START_S + float(row["time"])
    raise AssertionError("nothing is dropped in this trial")


def replayed(path: Path, capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    assert main(["replay", str(path), "--speed", "max", "--json"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    return [json.loads(line) for line in captured.out.splitlines()]


def test_a_real_drop_is_warned_of_a_second_before(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = [body for body in replayed(recording, capsys) if body["topic"] == "warning"]
    first = next(body for body in told if body["level"] == "warning")
    assert first["t_ns"] * 1e-9 <= drop_s() - 1.0
    for finger in ("left", "right"):
        warned = [body["t_ns"] * 1e-9 for body in told if body["finger"] == finger and body["level"] == "warning"]
        assert min(warned) <= drop_s() - 1.0
    after = [body["level"] for body in told if body["t_ns"] * 1e-9 > drop_s() + 0.2]
    assert "warning" not in after
    assert after, "the end of the trial is told stale"


def test_replayed_messages_are_complete_and_one_per_line(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bodies = replayed(recording, capsys)
    numbers: dict[str, list[int]] = {}
    for body in bodies:
        numbers.setdefault(body["topic"], []).append(body["seq"])
    assert set(numbers) == {
        *("warning", "status", "slip.left", "slip.right", "wrench.left", "wrench.right"),
        *("tactile.left", "tactile.right"),
    }
    assert all(found == list(range(len(found))) for found in numbers.values())
    assert bodies == replayed(recording, capsys)


def test_without_json_a_replay_prints_the_changes_of_level(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(recording), "--speed", "max"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(
        line.endswith("left: caution → slipping (slip_detected, translation; moves by image_change)") for line in lines
    )
    assert lines[-1].strip().startswith("5.8")
    assert "(stale)" in lines[-1]


def test_a_replay_is_published_to_subscribers(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(tmp_path / "run"))
    heard: list[list[bytes]] = []
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    subscriber = context.socket(zmq.SUB)
    subscriber.setsockopt(zmq.SUBSCRIBE, b"slip.")
    subscriber.connect(f"ipc://{tmp_path}/run/publish")

    def listen() -> None:
        while not heard and subscriber.poll(30_000):
            heard.append(subscriber.recv_multipart())

    listener = threading.Thread(target=listen)
    listener.start()
    for _ in range(10):  # on a busy machine a replay may have ended before the subscriber has found it
        assert main(["replay", str(recording), "--speed", "4", "--publish"]) == 0
        if heard:
            break
    listener.join()
    context.destroy(linger=0)
    assert heard[0][0] in (b"slip.left", b"slip.right")
    assert decode(heard[0][1], MESSAGE_LIMITS)["boot"] == "imported"
    captured = capsys.readouterr()
    assert captured.out.startswith(f"publish: ipc://{tmp_path}/run/publish\n")
    assert captured.err.startswith("slipd: replays at 4 times real time; as fast as possible: --speed max\n")


@pytest.mark.process
def test_a_closed_output_pipe_is_not_an_error(recording: Path) -> None:
    """``slipd replay FILE --json | head -1``."""
    with subprocess.Popen(
        [SLIPD, "replay", str(recording), "--speed", "max", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert json.loads(process.stdout.readline())["topic"] == "status"
        process.stdout.close()
        assert process.stderr.read() == ""
        assert process.wait(60) == 0
