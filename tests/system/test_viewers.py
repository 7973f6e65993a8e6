"""A real daemon on the virtual gripper, `slipctl serve foxglove`, and a client that is not ours."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from foxglove_client import FoxgloveClient, Received
from project import ROOT

pytestmark = pytest.mark.process

PATIENCE_S = 60.0

TOPICS = {
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/slipd/left/slip": "slipd_msgs/msg/Slip",
    "/slipd/left/contact": "geometry_msgs/msg/PointStamped",
    "/slipd/left/wrench": "geometry_msgs/msg/WrenchStamped",
    "/slipd/left/wrench_reading": "slipd_msgs/msg/WrenchReading",
    "/slipd/left/tactile": "slipd_msgs/msg/Tactile",
    "/slipd/left/image": "sensor_msgs/msg/Image",
    "/slipd/warning": "slipd_msgs/msg/SlipWarning",
    "/slipd/grasp": "slipd_msgs/msg/Grasp",
    "/slipd/gripper": "slipd_msgs/msg/Gripper",
}


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts a module as a process with a runtime directory of the test."""
    environment = os.environ | {"SLIPD_RUNTIME_DIR": str(tmp_path / "run")}
    with ExitStack() as stack:

        def run(*command: str) -> subprocess.Popen[str]:
            process = stack.enter_context(
                subprocess.Popen(
                    [sys.executable, "-m", *command], env=environment, stdout=subprocess.PIPE, encoding="utf-8"
                )
            )
            stack.callback(process.terminate)
            return process

        yield run


def test_a_client_that_is_not_ours_decodes_every_topic_of_the_running_daemon(
    start: Callable[..., subprocess.Popen[str]],
) -> None:
    daemon = start("slipd", "demo", "--headless")
    assert daemon.stdout is not None
    while not daemon.stdout.readline().startswith("requests: "):
        assert daemon.poll() is None, "the daemon does not start"
    config = str(ROOT / "config" / "demo.toml")
    viewers = start("slipd_client.slipctl", "serve", "foxglove", "--listen", "127.0.0.1:0", "--config", config)
    assert viewers.stdout is not None
    url = viewers.stdout.readline().removeprefix("foxglove: ").strip()
    found: dict[str, Received] = {}
    with FoxgloveClient(url) as client:
        client.subscribe(*TOPICS)
        while set(found) != set(TOPICS):
            received = client.receive()
            found[received.topic] = received
    assert {topic: received.type for topic, received in found.items()} == TOPICS
    messages = {topic: received.message for topic, received in found.items()}
    assert messages["/slipd/left/slip"].finger == "left"
    assert messages["/slipd/left/wrench"].header.frame_id == messages["/slipd/left/tactile"].header.frame_id
    assert (messages["/slipd/left/image"].height, messages["/slipd/left/image"].width) == (8, 16)
    assert {each.child_frame_id for each in messages["/tf"].transforms} == {"left_pad", "right_pad"}
    assert {"slipd: left.wrench", "slipd: gripper"} <= {each.name for each in messages["/diagnostics"].status}
    for topic in ("/slipd/left/slip", "/slipd/left/wrench"):
        stamp = messages[topic].header.stamp
        assert found[topic].log_ns >= stamp.sec * 10**9 + stamp.nanosec - 1000
