"""The stream of the arm from another participant of a DDS domain to the daemon's own decoder."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import zmq
from scipy.spatial.transform import Rotation

pytest.importorskip("cyclonedds", reason="needs cyclonedds, the extra `ros2`")

from cyclonedds.domain import DomainParticipant
from ros_graph import free_domain, joined

from slipd.devices.external import Decoder
from slipd_client.errors import CallError
from slipd_client.messages import Health
from slipd_client.ros.conversion import RosMessage
from slipd_client.ros2.arm_feed import ArmFeed, ArmPort, ImuReadings, arm_port
from slipd_client.ros2.dds import RosPublisher
from slipd_client.ros2.orientation import IDENTITY

if TYPE_CHECKING:
    from conftest import Daemon, Publisher

PATIENCE_S = 40.0
CONFIG = """
[grasp.pads.left]
positions = [[0.0, 0.0, 0.0, 0.0], [0.1, 0.0, 0.05, 0.0]]
quat_xyzw = [0.5, -0.5, 0.5, 0.5]

[grasp.arm]
device = "external"
port = "{port}"
sensor = "arm"
rate_hz = 250.0
stale_s = 0.1
"""
ZERO = dict.fromkeys("xyz", 0.0)
TILT = Rotation.from_euler("x", 90, degrees=True)


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
    pull = Pull(f"ipc://{tmp_path}/arm")
    yield pull
    pull.close()


def header(ago_ns: int, frame: str) -> dict[str, Any]:
    sec, nanosec = divmod(time.time_ns() - ago_ns, 10**9)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame}


def transform(ago_ns: int) -> RosMessage:
    rotation = dict(zip("xyzw", map(float, TILT.as_quat()), strict=True))
    entry = {"header": header(ago_ns, "base_link"), "child_frame_id": "tool0"}
    value = {"transforms": [entry | {"transform": {"translation": ZERO, "rotation": rotation}}]}
    return RosMessage("/tf", "tf2_msgs/TFMessage", value)


def imu(ago_ns: int, known: float = 0.0) -> RosMessage:
    value = {
        "header": header(ago_ns, "imu"),
        "orientation": ZERO | {"w": 1.0},
        "orientation_covariance": [-1.0] + [0.0] * 8,
        "angular_velocity": ZERO,
        "angular_velocity_covariance": [0.0] * 9,
        "linear_acceleration": ZERO | {"z": 9.80665},
        "linear_acceleration_covariance": [known] + [0.0] * 8,
    }
    return RosMessage("/imu", "sensor_msgs/Imu", value)


def until(condition: Callable[[], Any], meanwhile: Callable[[], object]) -> Any:
    end_s = time.monotonic() + PATIENCE_S
    while not (found := condition()):
        assert time.monotonic() < end_s, "it never came"
        meanwhile()
        time.sleep(0.05)
    return found


def test_transforms_become_readings_of_the_arm_that_the_daemon_decodes(
    publisher: Publisher, daemon: Daemon, slipctl: Callable[..., subprocess.Popen[str]], pull: Pull, tmp_path: Path
) -> None:
    variables = free_domain()
    (tmp_path / "rig.toml").write_text(CONFIG.format(port=pull.endpoint), encoding="utf-8")
    process = slipctl(
        *("--publish", publisher.endpoint, "--requests", daemon.endpoint, "serve", "ros2"),
        *("--config", str(tmp_path / "rig.toml"), "--hand", "tool0", "--orientation-from", "base_link"),
        env=os.environ | variables,
    )
    with joined(variables) as participant:
        robot = RosPublisher(participant, {})

        def move() -> None:
            for i in range(10):
                robot.publish(transform((9 - i) * 4_000_000))

        sample = until(pull.arm, move)[-1]
    assert sample.source == "arm"
    assert sample.gravity_mps2 == pytest.approx([0.0, -9.80665, 0.0], abs=1e-6)
    assert sample.angular_velocity_radps == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    assert (sample.t_ns - sample.device_time_ns) * 1e-9 >= 0.015, "the delay of the filter is in its time"
    assert [op for op in daemon.ops if op == "gravity.set"] == []
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, "Traceback" in errors) == (130, False)


def states(feed: ArmFeed) -> tuple[int, str]:
    return feed._state[0], feed._state[1]


def test_an_imu_is_pushed_and_the_reason_is_reported_where_it_is_not(pull: Pull) -> None:
    with joined(free_domain()) as participant, ExitStack() as stack:
        robot = RosPublisher(participant, {})
        feed = ArmFeed(
            participant, ArmPort(pull.endpoint, "wrist"), ImuReadings(participant, "/imu", IDENTITY, (0, 0, 0))
        )
        feed.start()
        stack.callback(feed.stop)
        until(lambda: states(feed) == (Health.STALE, "no message has come on /imu"), lambda: None)
        for message, why in (
            (lambda: imu(0, known=-1.0), "has no linear_acceleration"),
            (lambda: imu(10**9), "behind this machine's clock"),
            (lambda: imu(0), "too few new stamps within 0.02 s"),
        ):
            until(lambda why=why: why in states(feed)[1], lambda message=message: robot.publish(message()))

        def turn() -> None:
            for ago_ns in (16_000_000, 8_000_000, 0):
                robot.publish(imu(ago_ns))

        sample = until(pull.arm, turn)[-1]
        assert (sample.source, sample.gravity_mps2) == ("wrist", pytest.approx([0.0, 0.0, -9.80665]))
        until(lambda: states(feed)[0] is Health.OK, turn)
        pull.close()
        until(lambda: "no daemon takes it at ipc://" in states(feed)[1], turn)


def test_a_port_that_is_none_is_refused() -> None:
    with joined(free_domain()) as participant, pytest.raises(CallError, match="must be an endpoint, got 'nowhere'"):
        ArmFeed(participant, ArmPort("nowhere", "arm"), _source(participant))


def _source(participant: DomainParticipant) -> ImuReadings:
    return ImuReadings(participant, "/imu", IDENTITY, (0.0, 0.0, 0.0))


def test_only_a_stream_that_programs_push_is_sent_and_its_readings_must_not_be_stale_by_the_filter() -> None:
    arm: dict[str, Any] = {"device": "external", "port": "ipc:///a", "sensor": "arm", "rate_hz": 250.0}
    assert arm_port({"grasp": {}}, 0.04) is None
    assert arm_port({"grasp": {"arm": arm | {"device": "myrobot"}}}, 0.04) is None
    assert arm_port({"grasp": {"arm": arm}}, 0.02) == ArmPort("ipc:///a", "arm")
    assert arm_port({"grasp": {"arm": arm | {"rate_hz": 50.0}}}, 0.04) == ArmPort("ipc:///a", "arm")
    with pytest.raises(CallError, match=r"stale_s of \[grasp.arm\] must be at least 0.04, got 0.02"):
        arm_port({"grasp": {"arm": arm}}, 0.04)
    with pytest.raises(CallError, match="must have port, sensor and rate_hz"):
        arm_port({"grasp": {"arm": {"device": "external"}}}, 0.04)
