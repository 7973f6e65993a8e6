"""The commands slipd import and slipd replay on a real trial: output and exit codes."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path

import pytest
import zmq
from project import TRIAL

from slipd.cli import main
from slipd_client.messages import MESSAGE_LIMITS, decode

START_S = 1.0  # where an imported trial begins
SLIPD = str(Path(sys.executable).with_name("slipd"))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The trial in which the object is dropped, imported with the shipped config."""
    out = tmp_path_factory.mktemp("imported") / "trial.mcap"
    assert main(["import", "grips", str(TRIAL), str(out)]) == 0
    return out


def drop_s() -> float:
    """Time of the drop: the first row with that label."""
    with (TRIAL / "slip_label.csv").open() as labels, (TRIAL / "robot_state.csv").open() as times:
        for label, row in zip(csv.DictReader(labels), csv.DictReader(times), strict=True):
            if float(label["fail"]):
                return START_S + float(row["time"])
    raise AssertionError("nothing is dropped in this trial")


def test_every_message_of_a_replay_is_a_line_and_a_real_drop_is_warned_of_a_second_before(
    recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(recording), "--speed", "max", "--json"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    bodies = [json.loads(line) for line in captured.out.splitlines()]
    numbers: dict[str, list[int]] = {}
    for body in bodies:
        numbers.setdefault(body["topic"], []).append(body["seq"])
    kinds = [f"{kind}.{finger}" for kind in ("slip", "wrench", "tactile") for finger in ("left", "right")]
    assert numbers == {topic: list(range(len(numbers[topic]))) for topic in ("warning", "status", *kinds)}
    told = [body for body in bodies if body["topic"] == "warning"]
    for finger in ("left", "right"):
        first = next(body for body in told if (body["finger"], body["level"]) == (finger, "warning"))
        assert first["t_ns"] * 1e-9 <= drop_s() - 1.0
    after = [body["level"] for body in told if body["t_ns"] * 1e-9 > drop_s() + 0.2]
    assert after, "the end of the trial is told stale"
    assert "warning" not in after


def test_without_json_a_replay_prints_the_changes_of_level(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(recording), "--speed", "max"]) == 0
    lines = capsys.readouterr().out.splitlines()
    slip = "left: caution → slipping (slip_detected, translation; moves by image_change)"
    assert [line for line in lines if line.endswith(slip)]
    assert (lines[-1].strip()[:3], "(stale)" in lines[-1]) == ("4.8", True), "seconds since the begin"


def test_a_replay_is_published_to_subscribers(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(tmp_path / "run"))
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    subscriber = context.socket(zmq.SUB)
    subscriber.setsockopt(zmq.SUBSCRIBE, b"slip.")
    subscriber.connect(f"ipc://{tmp_path}/run/publish")
    for _ in range(10):  # on a busy machine a replay may have ended before the subscriber has found it
        assert main(["replay", str(recording), "--speed", "4", "--publish"]) == 0
        if subscriber.poll(100):
            break
    topic, body = subscriber.recv_multipart(zmq.NOBLOCK)
    context.destroy(linger=0)
    assert topic in (b"slip.left", b"slip.right")
    assert decode(body, MESSAGE_LIMITS)["boot"] == "imported"
    captured = capsys.readouterr()
    assert captured.out.startswith(f"publish: ipc://{tmp_path}/run/publish\n")
    assert captured.err.startswith("slipd: replays at 4 times real time; as fast as possible: --speed max\n")


@pytest.mark.process
def test_a_closed_output_pipe_is_not_an_error(recording: Path) -> None:
    line = f"{SLIPD} replay {recording} --speed max --json | head -1"
    done = subprocess.run(["bash", "-o", "pipefail", "-c", line], capture_output=True, text=True, timeout=100)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["topic"] == "status"
