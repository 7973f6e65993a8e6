"""Orientation and stream of the arm, from publishers of a DDS domain that come and go, to the daemon."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
import ros_values
import zmq
from client_peers import PATIENCE_S, Daemon, Publisher, until
from ros_peers import typestore
from scipy.spatial.transform import Rotation

pytest.importorskip("cyclonedds", reason="needs cyclonedds, the extra `ros2`")

from cyclonedds.domain import DomainParticipant
from ros_graph import free_domain, joined, reader

from slipd.devices.external import Decoder
from slipd_client.errors import CallError
from slipd_client.grip import GripClient
from slipd_client.messages import Health
from slipd_client.quaternions import IDENTITY, Quaternion
from slipd_client.ros import feeds
from slipd_client.ros.arm_motion import Imu
from slipd_client.ros.conversion import RosMessage
from slipd_client.ros.dds import RosPublisher
from slipd_client.ros.feeds import ArmFeed, ArmPort, OrientationFeed, RosFeed, arm_port

PADS = """
[grasp.pads.left]
positions = [[0.0, 0.0, 0.0, 0.0], [0.1, 0.0, 0.05, 0.0]]
quat_xyzw = [0.5, -0.5, 0.5, 0.5]
"""
ARM = """
[grasp.arm]
device = "external"
port = "{port}"
sensor = "arm"
rate_hz = 250.0
stale_s = 0.1
"""
STORE = typestore()
TILTED: Quaternion = (0.6, 0.0, 0.0, 0.8)


class Pull:
    """The daemon's side of the push socket."""

    def __init__(self, endpoint: str) -> None:
        self.endpoint = endpoint
        self._socket = zmq.Context.instance().socket(zmq.PULL)
        self._socket.bind(endpoint)
        self._decoder = Decoder()

    def arm(self) -> list[Any]:
        """Return the readings that have arrived."""
        found = []
        while self._socket.poll(0):
            found += self._decoder.receive(self._socket.recv(), time.monotonic_ns())
        assert self._decoder.health.bad == 0
        return found

    def close(self) -> None:
        self._socket.close(linger=0)


@pytest.fixture
def pull(tmp_path: Path) -> Iterator[Pull]:
    with closing(Pull(f"ipc://{tmp_path}/arm")) as pull:
        yield pull


def moved(stamp_ns: int, parent: str, child: str, rotation: Rotation, topic: str = "/tf") -> RosMessage:
    entry = ros_values.transform(stamp_ns, parent, child, rotation.as_quat())
    return RosMessage(topic, "tf2_msgs/TFMessage", {"transforms": [entry]})


def imu(stamp_ns: int, **values: Any) -> RosMessage:
    return RosMessage("/imu", "sensor_msgs/Imu", ros_values.imu(stamp_ns, **values))


def arrived(readings: Any, name: str) -> list[Any]:
    return [STORE.deserialize_cdr(sample.data, name) for sample in readings.take(50)]


@pytest.fixture
def serving(
    publisher: Publisher, daemon: Daemon, slipctl: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> Callable[[str], AbstractContextManager[Any]]:
    """Runs ``slipctl serve ros2`` with this config and transforms of base_link; yields process and participant."""

    @contextmanager
    def serve(config: str) -> Iterator[Any]:
        variables = free_domain()
        (tmp_path / "rig.toml").write_text(config, encoding="utf-8")
        process = slipctl(
            *("--publish", publisher.endpoint, "--requests", daemon.endpoint, "serve", "ros2"),
            *("--config", str(tmp_path / "rig.toml"), "--hand", "tool0", "--orientation-from", "base_link"),
            env=os.environ | variables,
            silence_s=0.5,
        )
        assert process.stdout.readline() == f"ros2: domain {variables['ROS_DOMAIN_ID']}, topics /slipd/…\n"
        with joined(variables) as participant:
            yield process, participant
        process.send_signal(signal.SIGINT)
        rest, errors = process.communicate(timeout=PATIENCE_S)
        assert (process.returncode, rest, "Traceback" in errors) == (130, "", False)

    return serve


def test_orientation_goes_to_the_daemon_diagnostics_and_the_frame_of_the_gripper_to_ros(
    publisher: Publisher, daemon: Daemon, serving: Callable[[str], AbstractContextManager[Any]]
) -> None:
    arm, flange = Rotation.random(2, random_state=3)
    with serving(PADS) as (process, participant):
        robot = RosPublisher(participant, {"/tf_static": 1})
        robot.publish(moved(0, "flange", "tool0", flange, "/tf_static"))
        request = until(
            lambda: [each for each in daemon.requests if each["op"] == "gravity.set"],
            lambda: robot.publish(moved(time.time_ns(), "base_link", "flange", arm)),
        )[-1]
        pad = arm * flange * Rotation.from_quat([0.5, -0.5, 0.5, 0.5])
        gravity = pytest.approx([0.0, 0.0, -9.80665], abs=1e-9)
        assert (request["finger"], pad.apply(request["gravity_mps2"])) == ("left", gravity)

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

        until(lambda: daemon_is(0), lambda: publisher.send("status", 1, timestamp=1.0, frame="", config_id="c"))
        assert "slipd: orientation from ROS" in levels
        until(lambda: daemon_is(3))
        assert f"slipctl: no message from {publisher.endpoint} for 0.5 s. Is slipd running?\n" in process.stderr


def test_transforms_become_readings_of_the_arm_that_the_daemon_decodes(
    daemon: Daemon, serving: Callable[[str], AbstractContextManager[Any]], pull: Pull
) -> None:
    rotation = Rotation.from_euler("x", 90, degrees=True)
    with serving(PADS + ARM.format(port=pull.endpoint)) as (_, participant):
        robot = RosPublisher(participant, {})

        def move() -> None:
            for i in range(10):
                robot.publish(moved(time.time_ns() - (9 - i) * 4_000_000, "base_link", "tool0", rotation))

        sample = until(pull.arm, move)[-1]
    assert (sample.source, sample.gravity_mps2) == ("arm", pytest.approx([0.0, -9.80665, 0.0], abs=1e-6))
    assert sample.angular_velocity_radps == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    assert (sample.t_ns - sample.device_time_ns) * 1e-9 >= 0.015, "the delay of the filter is in its time"
    assert "gravity.set" not in daemon.ops


def on_the_gripper(participant: DomainParticipant) -> Imu:
    return Imu(participant, "/imu", IDENTITY, (0.0, 0.0, 0.0))


def test_an_imu_is_pushed_and_the_reason_is_reported_where_it_is_not(pull: Pull) -> None:
    with joined(free_domain()) as participant:
        robot = RosPublisher(participant, {})
        feed = ArmFeed(participant, ArmPort(pull.endpoint, "wrist"), on_the_gripper(participant))
        feed.start()
        until(lambda: feed._state[:2] == (Health.STALE, "no message has come on /imu"))
        for why, ago_ns, unknown in (
            ("has no linear_acceleration", 0, "linear_acceleration"),
            ("behind this machine's clock", 10**9, ""),
            ("too few new stamps within 0.02 s", 0, ""),
        ):
            until(
                lambda why=why: why in feed._state[1],
                lambda ago=ago_ns, unknown=unknown: robot.publish(imu(time.time_ns() - ago, unknown=unknown)),
            )

        def turn() -> None:
            for ago_ns in (16_000_000, 8_000_000, 0):
                robot.publish(imu(time.time_ns() - ago_ns))

        sample = until(pull.arm, turn)[-1]
        assert (sample.source, sample.gravity_mps2) == ("wrist", pytest.approx([0.0, 0.0, -9.80665]))
        until(lambda: feed._state[0] is Health.OK, turn)
        pull.close()
        until(lambda: "no daemon takes it at ipc://" in feed._state[1], turn)
        feed.stop()


def test_a_port_that_is_none_is_refused() -> None:
    with joined(free_domain()) as participant, pytest.raises(CallError, match="must be an endpoint, got 'nowhere'"):
        ArmFeed(participant, ArmPort("nowhere", "arm"), on_the_gripper(participant))


def test_only_a_stream_that_programs_push_is_sent_and_its_readings_must_not_be_stale_by_the_filter() -> None:
    arm: dict[str, Any] = {"device": "external", "port": "ipc:///a", "sensor": "arm", "rate_hz": 250.0}
    found = [
        arm_port({"grasp": grasp}, filter_s)
        for grasp, filter_s in (
            ({}, 0.04),
            ({"arm": arm | {"device": "myrobot"}}, 0.04),
            ({"arm": arm}, 0.02),
            ({"arm": arm | {"rate_hz": 50.0}}, 0.04),
        )
    ]
    assert found == [None, None, ArmPort("ipc:///a", "arm"), ArmPort("ipc:///a", "arm")]
    for table, complaint in (
        (arm, r"stale_s of \[grasp.arm\] must be at least 0.04, got 0.02"),
        ({"device": "external"}, "must have port, sensor and rate_hz"),
    ):
        with pytest.raises(CallError, match=complaint):
            arm_port({"grasp": {"arm": table}}, 0.04)


def test_an_imu_that_is_restarted_is_used_again() -> None:
    with joined(free_domain()) as participant:
        source = on_the_gripper(participant)
        for sec, orientation in ((1, IDENTITY), (2, TILTED)):
            publisher = RosPublisher(participant, {"/imu": 1})
            publisher.publish(imu(sec * 10**9, orientation=orientation))
            until(source.reader.read)
            del publisher
            until(lambda: not source.reader.get_matched_publications())
            for _ in range(2):
                assert source.orientation(now_s=float(sec)) == pytest.approx(orientation)


def test_a_failure_that_lasts_is_told_once_and_so_is_its_end(
    stepped: Callable[[Any], Any], capsys: pytest.CaptureFixture[str]
) -> None:
    clock, feed = stepped(feeds), RosFeed("motion")
    for seconds, level, why in (
        *((0, Health.OK, ""), (3, Health.STALE, "a"), (1, Health.STALE, "a"), (1, Health.STALE, "a")),
        *((1, Health.ERROR, "b"), (1, Health.OK, ""), (1, Health.OK, ""), (2, Health.STALE, "a")),
    ):
        clock.sleep(seconds)
        feed._report(level, why)
    told = "slipctl: no motion is sent: a\nslipctl: no motion is sent: b\nslipctl: the motion is sent again\n"
    assert capsys.readouterr().err == told


class OnceUndecodable:
    """A source whose first message cannot be decoded."""

    asked = 0

    def orientation(self, now_s: float) -> Quaternion:
        self.asked += 1
        if self.asked == 1:
            raise ValueError("'utf-8' codec can't decode byte 0xff")
        return IDENTITY


def test_a_message_that_cannot_be_decoded_does_not_end_the_feed(daemon: Daemon) -> None:
    with GripClient(daemon.endpoint) as client:
        feed = OrientationFeed(client, OnceUndecodable(), {"left": IDENTITY})
        feed.start()
        until(lambda: "gravity.set" in daemon.ops)
        feed.stop()
