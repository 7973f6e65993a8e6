"""'slipctl serve ros2': its arguments, names and rates, and ROS's environment variables."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path

import pytest

from slipd_client.errors import CallError
from slipd_client.ros.conversion import PadFrames, RosMessage, entry
from slipd_client.ros.dds import ros_environment
from slipd_client.ros.ros2_command import RosForwarder, hand_transform

pytest.importorskip("cyclonedds", reason="needs cyclonedds, the extra `ros2`")

HEADER = {"t_ns": 0, "timestamp": 1_700_000_000.5, "frame": "", "config_id": "c"}
PADS = """
[grasp.pads.left]
positions = [[0.0, 0.0, 0.0, 0.0], [0.1, 0.0, 0.05, 0.0]]
quat_xyzw = [0.5, -0.5, 0.5, 0.5]
"""


@pytest.fixture
def pads(tmp_path: Path) -> str:
    (tmp_path / "rig.toml").write_text(PADS, encoding="utf-8")
    return str(tmp_path / "rig.toml")


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ("--orientation-from base_link", "needs --hand FRAME"),
        ("--imu /imu", "--imu needs --config FILE"),
        ("--imu-mount 0 0 0 1", "--imu-mount belongs to --imu"),
        ("--imu-at 0 0 0", "--imu-at belongs to --imu"),
        ("--imu /imu --imu-mount 0 0 0 2 --config PADS", "must be a unit quaternion x y z w, got one of length 2"),
        ("--speed-scaling /jtc/speed_scaling_input", "needs --speed-floor"),
        ("--check-plans /plan", "needs --plan-frame FRAME"),
        ("--speed-floor 1", "must be from 0 to less than 1, got 1"),
        ("--imu /imu --orientation-from base", "not allowed with"),
        ("--prefix arm", "must be the full name of a topic"),
        ("--hand /tool0", "without a leading slash"),
        ("--domain 233", "must be an integer from 0 to 232, got '233'"),
        ("--wrench-rate 0.00099", "must be from 0.001 to 1e6 Hz, got 0.00099"),
        ("--wrench-rate 1000001", "must be from 0.001 to 1e6 Hz, got 1000001"),
        ("--wrench-rate 0.001 --imu /imu", "--imu needs --config FILE"),
        ("--wrench-rate 1e6 --imu /imu", "--imu needs --config FILE"),
        ("--domain 232 --imu /imu", "--imu needs --config FILE"),
        ("--wrench-rate fast", "must be a number, got 'fast'"),
        ("", "ROS_DOMAIN_ID must be an integer from 0 to 232, got 'x'"),
    ],
)
def test_arguments_and_variables_that_are_wrong_or_do_not_go_together_are_refused(
    arguments: str,
    complaint: str,
    call: Callable[..., tuple[int, str, str]],
    pads: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "x")
    code, _, errors = call("serve", "ros2", *arguments.replace("PADS", pads).split())
    assert (code, complaint in errors) == (2, True)


FRAMES = PadFrames({"left": {"positions": [[0, 0, 0, 0], [0.2, 0, 0.1, 0]], "quat_xyzw": [0.5, -0.5, 0.5, 0.5]}})


def test_topics_have_the_prefix_except_those_that_every_node_shares() -> None:
    sent: list[RosMessage] = []
    forwarder = RosForwarder(sent.append, prefix="/arm/slip", transforms_topic="/arm/tf", pads=FRAMES)
    for topic in ("slip.left", "wrench.left", "tactile.left", "warning", "grasp", "gripper", "status"):
        forwarder.forward(topic, {**HEADER, "rows": 1, "cols": 1, "width_m": 0.1})
    own = {f"/arm/slip/{name}" for name in ("warning", "grasp", "gripper")}
    fingers = {f"/arm/slip/left/{name}" for name in ("slip", "contact", "wrench", "wrench_reading", "tactile", "image")}
    assert {message.topic for message in sent} == own | fingers | {"/diagnostics", "/arm/tf"}


def test_a_wrench_rate_leaves_out_readings_and_keeps_the_mean_rate() -> None:
    sent: list[RosMessage] = []
    forwarder = RosForwarder(sent.append, wrench_rate_hz=100.0)
    for index, finger in itertools.product(range(250), ("left", "right")):
        forwarder.forward(f"wrench.{finger}", HEADER | {"finger": finger, "t_ns": index * 4_000_000})
    stamps = [message.value["t"]["nanosec"] for message in sent if message.topic == "/slipd/left/wrench_reading"]
    assert max(after - before for before, after in itertools.pairwise(stamps)) <= 12_000_000
    assert (len(stamps), sum(message.topic == "/slipd/right/wrench" for message in sent)) == (100, 100)


def test_silence_makes_every_entry_of_diagnostics_stale() -> None:
    sent: list[RosMessage] = []
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
    last, before = (message.value for message in (sent[-1], sent[1]))
    assert last["status"][0]["message"] == "nothing is heard"
    assert last["header"]["stamp"]["sec"] > before["header"]["stamp"]["sec"]


def test_the_gripper_is_a_child_of_the_hand() -> None:
    (transform,) = hand_transform("tool0")["transforms"]
    assert (transform["header"]["frame_id"], transform["child_frame_id"]) == ("tool0", "gripper")
    assert transform["transform"]["rotation"] == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}


PEERS = (
    "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
    "<Peers>{}</Peers></Discovery>"
)
LOCALHOST, ROBOTS = '<Peer address="localhost"/>', '<Peer address="robot"/><Peer address="10.0.0.7"/>'
ALONE = "<General><AllowMulticast>false</AllowMulticast></General>"
LOOPBACK = '<General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces></General>'
NONE = "<Discovery><ParticipantIndex>none</ParticipantIndex></Discovery>"
NAMED = {"ROS_STATIC_PEERS": "robot; 10.0.0.7;"}
OWN = "file:///etc/cyclonedds.xml"


@pytest.mark.parametrize(
    ("variables", "domains", "warning"),
    [
        ({}, [], ""),
        ({"ROS_DOMAIN_ID": "", "ROS_STATIC_PEERS": ";"}, [], ""),
        ({"ROS_LOCALHOST_ONLY": "0"}, [], ""),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT", "ROS_STATIC_PEERS": "robot"}, [], ""),
        ({"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}, [], ""),
        (NAMED, [PEERS.format(ROBOTS)], ""),
        (NAMED | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "localhost"}, [ALONE + PEERS.format(LOCALHOST + ROBOTS)], ""),
        (NAMED | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}, [ALONE + NONE], ""),
        (NAMED | {"ROS_LOCALHOST_ONLY": "1"}, [LOOPBACK, ALONE + PEERS.format(LOCALHOST)], ""),
        ({"CYCLONEDDS_URI": OWN}, [OWN], ""),
        (NAMED | {"CYCLONEDDS_URI": OWN}, [PEERS.format(ROBOTS), OWN], ""),
        ({"RMW_IMPLEMENTATION": "rmw_zenoh_cpp"}, [], "rmw_zenoh_cpp: its nodes do not speak DDS"),
        ({"ROS_SECURITY_ENABLE": "true"}, [], "slipctl has no keys for SROS 2"),
    ],
)
def test_the_reach_of_discovery_is_that_of_ros_and_the_own_configuration_comes_last(
    variables: dict[str, str], domains: list[str], warning: str
) -> None:
    found = ros_environment(variables)
    parts = [each if each is OWN else f"<CycloneDDS><Domain>{each}</Domain></CycloneDDS>" for each in domains]
    assert (found.domain, found.configuration, bool(found.warning)) == (0, ",".join(parts), bool(warning))
    assert warning in found.warning


@pytest.mark.parametrize(
    ("variables", "why"),
    [
        ({"ROS_DOMAIN_ID": "233"}, "ROS_DOMAIN_ID must be an integer from 0 to 232, got '233'"),
        ({"ROS_DOMAIN_ID": "-1"}, "got '-1'"),
        ({"ROS_DOMAIN_ID": "ten"}, "got 'ten'"),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "all"}, "must be one of SUBNET, LOCALHOST, OFF, SYSTEM_DEFAULT, got 'ALL'"),
    ],
)
def test_a_value_that_ros_does_not_know_is_refused(variables: dict[str, str], why: str) -> None:
    with pytest.raises(CallError, match=why):
        ros_environment(variables)
