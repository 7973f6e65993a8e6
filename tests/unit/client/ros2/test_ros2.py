"""'slipctl serve ros2': its process beside another participant, names and rates, and ROS's environment variables."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from client_peers import PATIENCE_S, Daemon, Publisher, until
from ros_peers import typestore
from scipy.spatial.transform import Rotation

from slipd_client.errors import CallError
from slipd_client.ros.conversion import PadFrames, RosMessage, entry
from slipd_client.ros2.ros2_command import RosForwarder, hand_transform
from slipd_client.ros2.ros_environment import ros_environment

pytest.importorskip("cyclonedds", reason="needs cyclonedds, the extra `ros2`")

from ros_graph import free_domain, joined, reader

from slipd_client.ros2.dds import RosPublisher

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


def test_orientation_goes_to_the_daemon_diagnostics_and_the_frame_of_the_gripper_to_ros(
    publisher: Publisher, daemon: Daemon, slipctl: Callable[..., subprocess.Popen[str]], pads: str
) -> None:
    variables = free_domain()
    process = slipctl(
        *("--publish", publisher.endpoint, "--requests", daemon.endpoint, "serve", "ros2", "--config", pads),
        *("--hand", "tool0", "--orientation-from", "base_link"),
        env=os.environ | variables,
        silence_s=0.5,
    )
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

        def joined_to_the_gripper() -> bool:
            found = [each.transforms[0] for each in arrived(frames, "tf2_msgs/msg/TFMessage")]
            return ("tool0", "gripper") in [(each.header.frame_id, each.child_frame_id) for each in found]

        until(joined_to_the_gripper)

        diagnostics = reader(participant, "/diagnostics", "diagnostic_msgs/DiagnosticArray", latched=False)
        levels: dict[str, int] = {}

        def daemon_is(level: int) -> bool:
            for array in arrived(diagnostics, "diagnostic_msgs/msg/DiagnosticArray"):
                levels.update({each.name: each.level for each in array.status})
            return levels.get("slipd: daemon") == level

        until(lambda: daemon_is(0), lambda: publisher.send("status", 1, **HEADER))
        assert "slipd: orientation from ROS" in levels
        until(lambda: daemon_is(3))
    shown = process.stderr.readline()
    process.send_signal(signal.SIGINT)
    rest, errors = process.communicate(timeout=PATIENCE_S)
    assert f"slipctl: no message from {publisher.endpoint} for 0.5 s. Is slipd running?\n" in shown + errors
    assert (process.returncode, rest, "Traceback" in errors) == (130, "", False)


def arrived(readings: Any, name: str) -> list[Any]:
    return [STORE.deserialize_cdr(sample.data, name) for sample in readings.take(50)]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ("--orientation-from base_link", "needs --hand FRAME"),
        ("--imu /imu", "--imu needs --config FILE"),
        ("--imu-mount 0 0 0 1", "--imu-mount belongs to --imu"),
        ("--imu-at 0 0 0", "--imu-at belongs to --imu"),
        ("--imu /imu --imu-mount 0 0 0 2 --config PADS", "must be a unit quaternion x y z w, got one of length 2"),
        ("--speed-scaling /jtc/speed_scaling_input", "needs --speed-floor"),
        ("--speed-floor 1", "must be from 0 to less than 1, got 1"),
        ("--imu /imu --orientation-from base", "not allowed with"),
        ("--prefix arm", "must be the full name of a topic"),
        ("--hand /tool0", "without a leading slash"),
        ("--domain 300", "must be an integer from 0 to 232, got '300'"),
        ("--wrench-rate 0", "must be from 0.001 to 1e6 Hz, got 0"),
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


def texts(configuration: str, path: str) -> list[str]:
    """Return the text or address of every element at a path in ``<Domain>``."""
    elements = [
        element
        for fragment in configuration.split(",")
        for element in ET.fromstring(fragment).findall(f"Domain/{path}")  # of the test's own configuration
    ]
    return [element.get("address") or element.text or "" for element in elements]


def test_without_variables_dds_is_left_to_its_defaults_in_domain_0() -> None:
    for variables in (
        {},
        {"ROS_DOMAIN_ID": "", "ROS_STATIC_PEERS": ";"},
        {"ROS_LOCALHOST_ONLY": "0"},
        {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT", "ROS_STATIC_PEERS": "robot"},
        {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"},
    ):
        assert ros_environment(variables) == (0, "", "")


PLACES = {
    "peers": "Discovery/Peers/Peer",
    "multicast": "General/AllowMulticast",
    "index": "Discovery/ParticipantIndex",
    "interface": "General/Interfaces/NetworkInterface",
}


@pytest.mark.parametrize(
    ("variables", "expected"),
    [
        ({}, {"peers": ["robot", "10.0.0.7"], "index": ["auto"]}),
        (
            {"ROS_AUTOMATIC_DISCOVERY_RANGE": "localhost"},
            {"peers": ["localhost", "robot", "10.0.0.7"], "multicast": ["false"], "index": ["auto"]},
        ),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}, {"multicast": ["false"], "index": ["none"]}),
        (
            {"ROS_LOCALHOST_ONLY": "1"},
            {"peers": ["localhost"], "multicast": ["false"], "index": ["auto"], "interface": ["127.0.0.1"]},
        ),
    ],
)
def test_the_reach_of_discovery_is_that_of_ros(variables: dict[str, str], expected: dict[str, list[str]]) -> None:
    found = ros_environment({"ROS_STATIC_PEERS": "robot; 10.0.0.7;"} | variables).configuration
    assert {name: shown for name, path in PLACES.items() if (shown := texts(found, path))} == expected


def test_the_configuration_of_cyclone_dds_comes_last_so_that_it_outranks_ours() -> None:
    own = "file:///etc/cyclonedds.xml"
    assert ros_environment({"CYCLONEDDS_URI": own}).configuration == own
    assert ros_environment({"CYCLONEDDS_URI": own, "ROS_STATIC_PEERS": "a"}).configuration.endswith(f",{own}")


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


def test_a_middleware_without_dds_and_security_are_warned_of() -> None:
    assert "rmw_zenoh_cpp" in ros_environment({"RMW_IMPLEMENTATION": "rmw_zenoh_cpp"}).warning
    assert "SROS" in ros_environment({"ROS_SECURITY_ENABLE": "true"}).warning
