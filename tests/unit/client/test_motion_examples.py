"""The examples that slow an arm down, beside the other side's own messages: RTDE of a UR, twists of MoveIt Servo."""

from __future__ import annotations

import importlib
import socket
import struct
import sys
import threading
import time
from types import ModuleType, SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
import ur_speed
from ros_peers import typestore

from slipd_client.motion import MotionAdvisor

if TYPE_CHECKING:
    from conftest import Publisher

ADVICE = {"safety": 1.25, "wanted_acceleration_mps2": 3.0, "speed_scale": 0.6}
STORE = typestore()


class Robot(threading.Thread):
    """The RTDE server of a UR as its guide describes it: it answers the set-up, and sends a package for each input."""

    ANSWERS = (  # kind, payload that is asked, payload of the answer
        (b"V", b"\x00\x02", b"\x01"),
        (b"O", struct.pack(">d", 50.0) + b"timestamp", b"\x01DOUBLE"),
        (b"I", b"speed_slider_mask,speed_slider_fraction", b"\x05UINT32,DOUBLE"),
        (b"S", b"", b"\x01"),
    )

    def __init__(self, until: float) -> None:
        super().__init__(daemon=True)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self.sliders: list[float] = []
        self._until = until
        self.start()

    def run(self) -> None:
        """Serve one program until its slider reaches ``until``."""
        with self._listener:
            connection, _ = self._listener.accept()
        with connection, connection.makefile("rwb") as stream:
            for kind, wanted, answer in self.ANSWERS:
                if self._next(stream) != (kind, wanted):
                    return
                self._send(stream, b"M", b"\x04text\x05robot\x00")  # it may come at any time
                self._send(stream, kind, answer)
            while not self.sliders or self.sliders[-1] < self._until:
                self._send(stream, b"U", b"\x01" + struct.pack(">d", time.monotonic()))
                kind, payload = self._next(stream)
                if not payload:
                    return
                recipe, mask, fraction = struct.unpack(">BId", payload)
                if (kind, recipe, mask) != (b"U", 5, 1):
                    return
                self.sliders.append(fraction)

    def _next(self, stream: Any) -> tuple[bytes, bytes]:
        header = stream.read(3)
        size, kind = struct.unpack(">Hc", header or b"\x00\x03-")  # the program has ended
        return kind, stream.read(size - 3)

    def _send(self, stream: Any, kind: bytes, payload: bytes) -> None:
        stream.write(struct.pack(">Hc", len(payload) + 3, kind) + payload)
        stream.flush()


class Advice(threading.Thread):
    """Publishes advice until it is ended."""

    def __init__(self, publisher: Publisher) -> None:
        super().__init__(daemon=True)
        self._publisher, self._ended = publisher, threading.Event()
        self.start()

    def run(self) -> None:
        """Publish fifty times a second."""
        seq = 0
        while not self._ended.wait(0.02):
            seq += 1
            self._publisher.send("motion", seq, **ADVICE)

    def end(self) -> None:
        """End the thread."""
        self._ended.set()
        self.join()


def test_the_slider_of_a_ur_rises_slowly_from_the_floor_to_the_scale(publisher: Publisher) -> None:
    advice, robot = Advice(publisher), Robot(until=0.6)
    with pytest.raises(SystemExit, match="the robot closed the connection"):
        ur_speed.main("127.0.0.1", robot.port, publisher.endpoint)
    robot.join()
    advice.end()
    assert robot.sliders[0] <= ur_speed.FLOOR + ur_speed.RISE
    assert max(robot.sliders) == pytest.approx(0.6)
    steps = [after - before for before, after in zip(robot.sliders, robot.sliders[1:], strict=False)]
    assert max(steps) < ur_speed.RISE + 1e-9


def test_a_robot_that_has_no_slider_to_move_is_named(publisher: Publisher) -> None:
    taken = b"\x00IN_USE,IN_USE"
    robot = Robot(until=0.0)
    robot.ANSWERS = (*Robot.ANSWERS[:2], (*Robot.ANSWERS[2][:2], taken), Robot.ANSWERS[3])
    with pytest.raises(SystemExit, match="does not let this program move the slider: IN_USE,IN_USE"):
        ur_speed.main("127.0.0.1", robot.port, publisher.endpoint)
    robot.join()


def ros(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Put stand-ins of rclpy in its place, with the messages of rosbags; return what the node publishes."""
    published: list[Any] = []

    class Node:
        def __init__(self, _: str) -> None:
            self.get_logger = lambda: SimpleNamespace(warning=lambda *_, **__: None)

        def declare_parameter(self, _: str, default: float) -> Any:
            return SimpleNamespace(value=default)

        def create_publisher(self, *_: Any) -> Any:
            return SimpleNamespace(publish=published.append)

        def create_subscription(self, kind: Any, _: str, callback: Any, __: int) -> None:
            self.kind, self.callback = kind, callback

    modules = {
        "rclpy": {},
        "rclpy.executors": {"ExternalShutdownException": KeyboardInterrupt},
        "rclpy.node": {"Node": Node},
        "geometry_msgs": {},
        "geometry_msgs.msg": {"TwistStamped": STORE.types["geometry_msgs/msg/TwistStamped"]},
    }
    for name, names in modules.items():
        module = ModuleType(name)
        vars(module).update(names)
        monkeypatch.setitem(sys.modules, name, module)
    return published


def twist(x: float) -> Any:
    """Return a twist as its bytes arrive: by the definition of ROS."""
    kinds = {name: STORE.types[f"geometry_msgs/msg/{name}"] for name in ("Vector3", "Twist", "TwistStamped")}
    stamp = STORE.types["builtin_interfaces/msg/Time"](sec=1, nanosec=2)
    header = STORE.types["std_msgs/msg/Header"](stamp=stamp, frame_id="tool0")
    linear, angular = kinds["Vector3"](x=x, y=0.0, z=-x), kinds["Vector3"](x=0.0, y=x, z=0.0)
    sent = kinds["TwistStamped"](header=header, twist=kinds["Twist"](linear=linear, angular=angular))
    name = "geometry_msgs/msg/TwistStamped"
    return STORE.deserialize_cdr(STORE.serialize_cdr(sent, name), name)


def test_twists_for_servo_are_slowed_to_the_floor_and_then_to_the_scale(
    publisher: Publisher, monkeypatch: pytest.MonkeyPatch
) -> None:
    published = ros(monkeypatch)
    example = importlib.import_module("servo_speed")
    with MotionAdvisor(publisher.endpoint) as advisor:
        node: Any = example.ServoSpeed(advisor)
        assert node.kind is STORE.types["geometry_msgs/msg/TwistStamped"]
        node.callback(twist(1.0))
        assert (published[-1].twist.linear.x, published[-1].header.frame_id) == (0.2, "tool0")
        advice, until_s = Advice(publisher), time.monotonic() + 60
        while published[-1].twist.linear.x != 0.6:
            assert time.monotonic() < until_s
            node.callback(twist(1.0))
            time.sleep(0.01)
        advice.end()
    last = published[-1].twist
    assert (last.linear.z, last.angular.y) == (-0.6, 0.6)
    STORE.serialize_cdr(published[-1], "geometry_msgs/msg/TwistStamped")
    sys.modules.pop("servo_speed")
