"""A real daemon on the virtual gripper, `slipctl serve foxglove`, and a client that is not ours."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest
from foxglove_client import FoxgloveClient, Received
from project import CONFIG
from rig_parts import endpoints_of, first_line, part

pytestmark = pytest.mark.process

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


def test_a_client_that_is_not_ours_decodes_every_topic_of_the_running_daemon(tmp_path: Path) -> None:
    serve = ("serve", "foxglove", "--listen", "127.0.0.1:0", "--config", str(CONFIG / "demo.toml"))
    with ExitStack() as stack:
        endpoints_of(stack.enter_context(part(tmp_path, "slipd", "demo", "--headless")))
        viewers = stack.enter_context(part(tmp_path, "slipd_client.slipctl", *serve))
        client = stack.enter_context(FoxgloveClient(first_line(viewers).removeprefix("foxglove: ")))
        client.subscribe(*TOPICS)
        found: dict[str, Received] = {}
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
