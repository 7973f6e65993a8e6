"""What is made of the daemon's messages for ROS: names, rates, and silence."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from slipd_client.ros.conversion import PadFrames, RosMessage, entry
from slipd_client.ros2.ros2_command import RosForwarder, hand_transform

PADS = PadFrames({"left": {"positions": [[0, 0, 0, 0], [0.2, 0, 0.1, 0]], "quat_xyzw": [0.5, -0.5, 0.5, 0.5]}})
HEADER = {"timestamp": 1_700_000_000.5, "frame": "", "seq": 1}


@pytest.fixture
def sent() -> list[RosMessage]:
    return []


def wrench(t_ns: int) -> dict[str, Any]:
    return {**HEADER, "finger": "left", "t_ns": t_ns}


def test_topics_have_the_prefix_except_those_that_every_node_shares(sent: list[RosMessage]) -> None:
    forwarder = RosForwarder(sent.append, prefix="/arm/slip", transforms_topic="/arm/tf", pads=PADS)
    for topic in ("slip.left", "wrench.left", "tactile.left", "warning", "grasp", "gripper", "status"):
        forwarder.forward(topic, {**HEADER, "rows": 1, "cols": 1, "width_m": 0.1})
    own = {f"/arm/slip/{name}" for name in ("warning", "grasp", "gripper")}
    fingers = {f"/arm/slip/left/{name}" for name in ("slip", "contact", "wrench", "wrench_reading", "tactile", "image")}
    topics = {message.topic for message in sent}
    assert topics == own | fingers | {"/diagnostics", "/arm/tf"}


def test_a_wrench_rate_leaves_out_readings_and_keeps_the_mean_rate(sent: list[RosMessage]) -> None:
    forwarder = RosForwarder(sent.append, wrench_rate_hz=100.0)
    for index in range(250):
        forwarder.forward("wrench.left", wrench(index * 4_000_000))
        forwarder.forward("wrench.right", wrench(index * 4_000_000))
    stamps = [message.value["t"]["nanosec"] for message in sent if message.topic == "/slipd/left/wrench_reading"]
    assert len(stamps) == 100
    assert max(after - before for before, after in itertools.pairwise(stamps)) <= 12_000_000
    assert sum(message.topic == "/slipd/right/wrench" for message in sent) == 100


def test_silence_makes_every_entry_of_diagnostics_stale(sent: list[RosMessage]) -> None:
    own = entry("orientation from ROS", 0, "", "", {})
    forwarder = RosForwarder(sent.append, own_entry=lambda: own)
    forwarder.silent("nothing is heard")
    forwarder.forward("status", {**HEADER, "fingers": {"left": {"level": "stable"}}})
    forwarder.silent("nothing is heard")
    shown = [[(each["name"], each["level"]) for each in message.value["status"]] for message in sent]
    ours = ("slipd: orientation from ROS", 0)
    assert shown == [
        [("slipd: daemon", 3), ours],
        [("slipd: daemon", 0), ("slipd: finger left", 0), ours],
        [("slipd: daemon", 3), ("slipd: finger left", 3), ours],
    ]
    assert sent[-1].value["status"][0]["message"] == "nothing is heard"
    assert sent[-1].value["header"]["stamp"]["sec"] > sent[1].value["header"]["stamp"]["sec"]


def test_the_gripper_is_a_child_of_the_hand() -> None:
    (transform,) = hand_transform("tool0")["transforms"]
    assert (transform["header"]["frame_id"], transform["child_frame_id"]) == ("tool0", "gripper")
    assert transform["transform"]["rotation"] == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
