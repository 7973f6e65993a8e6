"""`slipctl serve ros2` as a process, beside another participant of its domain."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from ros_peers import typestore
from scipy.spatial.transform import Rotation

from slipd_client.slipctl import main

pytest.importorskip("cyclonedds", reason="needs cyclonedds, the extra `ros2`")

from ros_graph import free_domain, joined, reader

from slipd_client.ros.conversion import RosMessage
from slipd_client.ros2.dds import RosPublisher

if TYPE_CHECKING:
    from conftest import Daemon, Publisher

PATIENCE_S = 40.0
STORE = typestore()
HEADER = {"timestamp": 1_700_000_000.5, "frame": "", "config_id": "c"}
PAD = (0.5, -0.5, 0.5, 0.5)
PADS = """
[grasp.pads.left]
positions = [[0.0, 0.0, 0.0, 0.0], [0.1, 0.0, 0.05, 0.0]]
quat_xyzw = [0.5, -0.5, 0.5, 0.5]
"""


@pytest.fixture
def pads(tmp_path: Path) -> str:
    (tmp_path / "rig.toml").write_text(PADS, encoding="utf-8")
    return str(tmp_path / "rig.toml")


def transforms(stamp_ns: int, parent: str, child: str, rotation: Rotation) -> dict[str, Any]:
    sec, nanosec = divmod(stamp_ns, 10**9)
    transform = {
        "translation": dict.fromkeys("xyz", 0.0),
        "rotation": dict(zip("xyzw", map(float, rotation.as_quat()), strict=True)),
    }
    header = {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": parent}
    return {"transforms": [{"header": header, "child_frame_id": child, "transform": transform}]}


def until(condition: Callable[[], Any], meanwhile: Callable[[], object] = lambda: None) -> Any:
    """Wait until a condition holds, and return its value."""
    end_s = time.monotonic() + PATIENCE_S
    while not (found := condition()):
        assert time.monotonic() < end_s, "it never came"
        meanwhile()
        time.sleep(0.02)
    return found


def test_orientation_goes_to_the_daemon_diagnostics_and_the_frame_of_the_gripper_to_ros(
    publisher: Publisher, daemon: Daemon, slipctl: Callable[..., subprocess.Popen[str]], pads: str
) -> None:
    variables = free_domain()
    process = slipctl(
        *("--publish", publisher.endpoint, "--requests", daemon.endpoint, "serve", "ros2", "--config", pads),
        *("--hand", "tool0", "--orientation-from", "base_link"),
        env=os.environ | variables,
    )
    assert process.stdout is not None
    assert process.stderr is not None
    assert process.stdout.readline() == f"ros2: domain {variables['ROS_DOMAIN_ID']}, topics /slipd/…\n"
    arm, flange = Rotation.random(2, random_state=3)
    with joined(variables) as participant:
        robot = RosPublisher(participant, {"/tf_static": 1})
        robot.publish(RosMessage("/tf_static", "tf2_msgs/TFMessage", transforms(0, "flange", "tool0", flange)))

        def move() -> None:
            message = transforms(time.time_ns(), "base_link", "flange", arm)
            robot.publish(RosMessage("/tf", "tf2_msgs/TFMessage", message))

        request = until(lambda: [each for each in daemon.requests if each["op"] == "gravity.set"], move)[-1]
        assert request["finger"] == "left"
        pad = arm * flange * Rotation.from_quat(PAD)
        assert pad.apply(request["gravity_mps2"]) == pytest.approx(np.array([0.0, 0.0, -9.80665]), abs=1e-9)

        frames = reader(participant, "/tf_static", "tf2_msgs/TFMessage", latched=True)
        found: set[tuple[str, str]] = set()

        def joined_to_the_gripper() -> bool:
            for sample in frames.take(5):
                (each,) = _decoded(sample, "tf2_msgs/msg/TFMessage").transforms
                found.add((each.header.frame_id, each.child_frame_id))
            return ("tool0", "gripper") in found

        until(joined_to_the_gripper)

        diagnostics = reader(participant, "/diagnostics", "diagnostic_msgs/DiagnosticArray", latched=False)
        publisher.wait_for_subscriber()
        heard: list[dict[str, int]] = []

        def health_of_the_daemon() -> int | None:
            for sample in diagnostics.take(50):
                array = _decoded(sample, "diagnostic_msgs/msg/DiagnosticArray")
                heard.append({each.name: each.level for each in array.status})
            return heard[-1]["slipd: daemon"] if heard else None

        until(lambda: health_of_the_daemon() == 0, lambda: publisher.send("status", 1, **HEADER))
        assert "slipd: orientation from ROS" in heard[-1]
        until(lambda: health_of_the_daemon() == 3)
    why = f"no message from {publisher.endpoint} for 3 s. Is slipd running?"
    shown = [process.stderr.readline()]
    process.send_signal(signal.SIGINT)
    rest, errors = process.communicate(timeout=PATIENCE_S)
    assert f"slipctl: {why}\n" in [*shown, *errors.splitlines(keepends=True)]
    assert (process.returncode, rest, "Traceback" in errors) == (130, "", False)


def _decoded(sample: Any, name: str) -> Any:
    return STORE.deserialize_cdr(sample.data, name)


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Return what the command says of arguments that it refuses."""
    try:
        code = main(["serve", "ros2", *arguments])
    except SystemExit as end:
        code = int(end.code or 0)
    assert code == 2
    return re.sub("^.*(error|slipctl): ", "", capsys.readouterr().err, flags=re.DOTALL).strip()


def test_arguments_that_do_not_go_together_are_refused(capsys: pytest.CaptureFixture[str], pads: str) -> None:
    assert "needs --hand FRAME" in refused(["--orientation-from", "base_link"], capsys)
    assert "--imu needs --config FILE" in refused(["--imu", "/imu"], capsys)
    assert refused(["--imu-mount", "0", "0", "0", "1"], capsys) == "--imu-mount belongs to --imu"
    assert refused(["--imu-at", "0", "0", "0"], capsys) == "--imu-at belongs to --imu"
    mount = ["--imu", "/imu", "--config", pads, "--imu-mount", "0", "0", "0", "2"]
    assert refused(mount, capsys) == "--imu-mount must be a unit quaternion x y z w, got one of length 2"
    assert "needs --speed-floor" in refused(["--speed-scaling", "/jtc/speed_scaling_input"], capsys)
    assert "must be from 0 to less than 1, got 1" in refused(["--speed-floor", "1"], capsys)
    assert "not allowed with" in refused(["--imu", "/imu", "--orientation-from", "base"], capsys)
    assert "must be the full name of a topic" in refused(["--prefix", "arm"], capsys)
    assert "without a leading slash" in refused(["--hand", "/tool0"], capsys)
    assert "must be an integer from 0 to 232, got '300'" in refused(["--domain", "300"], capsys)
    assert "must be from 0.001 to 1e6 Hz, got 0" in refused(["--wrench-rate", "0"], capsys)
    assert "must be a number, got 'fast'" in refused(["--wrench-rate", "fast"], capsys)


def test_variables_of_ros_that_are_wrong_are_refused(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "x")
    assert refused([], capsys) == "ROS_DOMAIN_ID must be an integer from 0 to 232, got 'x'"
