"""Advice on the motion of the arm, and the examples that follow it: what is not known, or old, is never full speed."""

from __future__ import annotations

import importlib
import itertools
import socket
import struct
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import msgpack
import pytest
import ur_speed
from client_peers import Daemon, Publisher, until
from hypothesis import given
from hypothesis import strategies as st
from imu_pusher import Packets, readings
from ros_peers import typestore
from scipy.spatial.transform import Rotation

from slipd.devices.external import Decoder
from slipd_client.aio import AsyncMotionAdvisor
from slipd_client.errors import CallError
from slipd_client.motion import STALE_S, MotionAdvisor, point_of

REPLY = {
    "utilisation": 1.2,
    "at_s": 0.3,
    "finger": "left",
    "mode": "translation",
    "grip_needed_n": 9.0,
    "time_scale": 0.8,
}


def received(advisor: MotionAdvisor, publisher: Publisher, **fields: Any) -> None:
    """Publish advice, and wait until the advisor has it."""
    seq = publisher.send("motion", **fields)
    until(lambda: getattr(advisor._newest, "seq", 0) == seq, advisor.advice)


@pytest.fixture
def advisor(publisher: Publisher, daemon: Daemon) -> Iterator[MotionAdvisor]:
    with MotionAdvisor(publisher.endpoint, daemon.endpoint) as advisor:
        publisher.wait_for(b"motion")
        yield advisor


def test_what_is_unknown_or_stale_or_ahead_of_its_time_is_the_floor_and_never_full_speed(
    advisor: MotionAdvisor, publisher: Publisher
) -> None:
    assert (advisor.speed_scale(), advisor.speed_scale(0.1)) == (None, 0.1)
    assert advisor.why_unknown.startswith("no advice has come")
    old_ns, ahead_ns = (time.monotonic_ns() + round(away_s * 1e9) for away_s in (-STALE_S - 0.01, 100.0))
    for fields, why in (
        ({"speed_scale": 1.0, "t_ns": old_ns}, "s old"),
        ({"speed_scale": 1.0, "t_ns": ahead_ns}, "s old"),
        ({"speed_scale": None, "unknown": "no object is held"}, "no object is held"),
        ({"speed_scale": 1.0, "unknown": "no object is held"}, "no object is held"),
        ({"speed_scale": None}, "no speed is known to hold"),
    ):
        received(advisor, publisher, **fields)
        assert (advisor.speed_scale(), advisor.speed_scale(0.2)) == (None, 0.2), fields
        assert why in advisor.why_unknown or "s old" in advisor.why_unknown, "this process may stall meanwhile"
    for floor in (1.0, -0.1, float("nan")):
        with pytest.raises(CallError, match="never full speed"):
            advisor.speed_scale(floor)


@pytest.mark.parametrize(("sent", "scale"), [(0.4, 0.4), (0.0, 0.0), (1.5, 1.0), (-0.5, 0.0)])
def test_a_scale_that_is_known_is_returned_and_is_at_most_full_speed(
    sent: float, scale: float, advisor: MotionAdvisor, publisher: Publisher
) -> None:
    far_ns = time.monotonic_ns() + 10**15  # the clock of a daemon elsewhere, that its reply has shown
    advisor.client.clock.observe(0, 0, 10**15)
    received(advisor, publisher, speed_scale=sent, t_ns=far_ns)
    assert advisor.speed_scale(0.9) in (scale, 0.9), "0.9 if this process stalls meanwhile"


async def test_a_trajectory_is_checked_by_either_advisor(publisher: Publisher, daemon: Daemon) -> None:
    daemon.handlers["motion.check"] = lambda _: REPLY
    with MotionAdvisor(publisher.endpoint, daemon.endpoint) as advisor:
        assert advisor.check([point_of(0.0, (0.0, 0.0, 0.0, 1.0), (1.0, 0.0, 2.0))]).time_scale == 0.8
    async with AsyncMotionAdvisor(publisher.endpoint, daemon.endpoint) as other:
        assert other.speed_scale(0.3) == 0.3
        assert (await other.check(acceleration_mps2=(0.0, 0.0, 2.0))).utilisation == 1.2
    assert [(request["op"], request.get("points"), request.get("acceleration_mps2")) for request in daemon.asked] == [
        ("motion.check", [[0.0, -1.0, 0.0, -11.80665, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]], None),
        ("motion.check", None, [0.0, 0.0, 2.0]),
    ]


def test_a_point_is_turned_into_the_gripper_frame_as_by_scipy() -> None:
    turn = Rotation.random(random_state=4)
    turned = turn.inv().apply([[-1.0, -2.0, -3.0 - 9.80665], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]])
    point = point_of(1.5, turn.as_quat(), (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0))
    assert point == pytest.approx([1.5, *turned.ravel()])


STORE = typestore()


SETUP = (  # kind, payload that is asked, payload of the answer
    (b"V", b"\x00\x02", b"\x01"),
    (b"O", struct.pack(">d", 50.0) + b"timestamp", b"\x01DOUBLE"),
    (b"I", b"speed_slider_mask,speed_slider_fraction", b"\x05UINT32,DOUBLE"),
    (b"S", b"", b"\x01"),
)
TEXT = b"\x00\x0fM\x04text\x05robot\x00"
"""A message of the robot that may come at any time."""


def package(kind: bytes, payload: bytes) -> bytes:
    return struct.pack(">Hc", len(payload) + 3, kind) + payload


@contextmanager
def robot(until: float, *, inputs: bytes = SETUP[2][2]) -> Iterator[tuple[int, list[float]]]:
    """Run the RTDE server of a UR as its guide describes it; yield its port, and the places of its slider.

    It answers the set-up, and sends a package for each input until the slider reaches ``until``.
    """
    sliders: list[float] = []

    def serve() -> None:
        with listener, listener.accept()[0] as connection, connection.makefile("rwb", 0) as stream:
            for kind, wanted, answer in SETUP:
                assert stream.read(len(wanted) + 3) == package(kind, wanted)
                stream.write(TEXT + package(kind, inputs if kind == b"I" else answer))
                if kind == b"I" and inputs != answer:
                    return
            while not sliders or sliders[-1] < until:
                stream.write(package(b"U", b"\x01" + struct.pack(">d", time.monotonic())))
                head, slider = struct.unpack(">8sd", stream.read(16))
                assert head == b"\x00\x10U\x05\x00\x00\x00\x01", "recipe of the input, and its mask"
                sliders.append(slider)

    listener = socket.create_server(("127.0.0.1", 0))
    with ThreadPoolExecutor() as threads:
        served = threads.submit(serve)
        yield listener.getsockname()[1], sliders
        served.result()


@contextmanager
def advised(publisher: Publisher) -> Iterator[None]:
    """Publish advice fifty times a second while the block runs."""
    ended = threading.Event()

    def advise() -> None:
        while not ended.wait(0.02):
            publisher.send("motion", speed_scale=0.6)

    with ThreadPoolExecutor() as threads, closing(SimpleNamespace(close=ended.set)):
        threads.submit(advise)
        yield


def test_the_slider_of_a_ur_rises_slowly_from_the_floor_to_the_scale(publisher: Publisher) -> None:
    with (
        robot(until=0.6) as (port, sliders),
        advised(publisher),
        pytest.raises(SystemExit, match="the robot closed the connection"),
    ):
        ur_speed.main("127.0.0.1", port, publisher.endpoint)
    steps = [after - before for before, after in itertools.pairwise([ur_speed.FLOOR, *sliders])]
    assert (max(sliders), max(steps) < ur_speed.RISE + 1e-9) == (pytest.approx(0.6), True)


def test_a_robot_that_has_no_slider_to_move_is_named(publisher: Publisher) -> None:
    with (
        robot(until=0.0, inputs=b"\x00IN_USE,IN_USE") as (port, _),
        pytest.raises(SystemExit, match="does not let this program move the slider: IN_USE,IN_USE"),
    ):
        ur_speed.main("127.0.0.1", port, publisher.endpoint)


class Node:
    """Stands in for a node of rclpy; keeps what it was given."""

    def __init__(self, _: str) -> None:
        self.published: list[Any] = []
        self.get_logger = Mock()
        self.declare_parameter = lambda _, default: SimpleNamespace(value=default)
        self.create_publisher = lambda *_: SimpleNamespace(publish=self.published.append)
        self.create_subscription = Mock()


TYPES = STORE.types
TWIST = TYPES["geometry_msgs/msg/TwistStamped"]


def twist() -> Any:
    """Return a twist of ROS's own type: 1 m/s along X and against Z, 1 rad/s about Y."""
    linear, angular = (TYPES["geometry_msgs/msg/Vector3"](*xyz) for xyz in ((1.0, 0.0, -1.0), (0.0, 1.0, 0.0)))
    header = TYPES["std_msgs/msg/Header"](TYPES["builtin_interfaces/msg/Time"](1, 2), "tool0")
    return TWIST(header, TYPES["geometry_msgs/msg/Twist"](linear, angular))


def test_twists_for_servo_are_slowed_to_the_floor_and_then_to_the_scale(
    publisher: Publisher, monkeypatch: pytest.MonkeyPatch
) -> None:
    modules = {"rclpy": {}, "rclpy.executors": {"ExternalShutdownException": KeyboardInterrupt}}
    modules |= {"rclpy.node": {"Node": Node}, "geometry_msgs": {}, "geometry_msgs.msg": {"TwistStamped": TWIST}}
    for name, names in modules.items():
        monkeypatch.setitem(sys.modules, name, SimpleNamespace(**names))
    monkeypatch.delitem(sys.modules, "servo_speed", raising=False)
    with MotionAdvisor(publisher.endpoint) as advisor:
        node: Any = importlib.import_module("servo_speed").ServoSpeed(advisor)
        kind, _, slow, _ = node.create_subscription.call_args.args
        slow(twist())
        slowed = node.published[-1]
        assert (kind, slowed.twist.linear.x, slowed.header.frame_id) == (TWIST, 0.2, "tool0")
        with advised(publisher):
            until(lambda: node.published[-1].twist.linear.x == 0.6, lambda: slow(twist()))
    assert (node.published[-1].twist.linear.z, node.published[-1].twist.angular.y) == (-0.6, 0.6)
    STORE.serialize_cdr(node.published[-1], TWIST.__msgtype__)


def packet(kind: int, *numbers: int) -> bytes:
    """Return a packet as the maker's guide has it; the fourth number is the temperature."""
    begin = struct.pack("<BB4h", 0x55, kind, *numbers, 2500)
    return begin + bytes([sum(begin) & 0xFF])


AT_REST = packet(0x51, 0, 0, 2048) + packet(0x52, 0, 164, 0)  # 1 g upwards along Z, 10 °/s about Y
DECOY = b"\x55\x51\x00" + packet(0x53, 1, 2, 3)[:-1] + b"\x00"


@given(st.binary(max_size=30), st.lists(st.integers(0, 60), max_size=6))
def test_packets_are_found_in_any_split_and_after_any_noise(noise: bytes, cuts: list[int]) -> None:
    data = noise + bytes(11) + DECOY + bytes(11) + 3 * AT_REST
    packets, newest, found = Packets(), {}, []
    for begin, end in itertools.pairwise([0, *sorted(cuts), len(data)]):
        found += list(readings(data[begin:end], packets, newest))
    assert len(found) >= 3
    assert found[-1]["angular_velocity_radps"] == pytest.approx([0.0, 0.1747, 0.0], abs=1e-4)
    (sample,) = Decoder().receive(msgpack.packb({"stream": "arm", "t_ns": 1, "seq": 0, **found[-1]}), 0)
    assert sample.gravity_mps2 == pytest.approx([0.0, 0.0, -9.80665])
