"""`slipctl bridge` as a process, between a publishing daemon and a real router."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from slipd_client.messages import decode, encode

pytest.importorskip("zenoh", reason="needs eclipse-zenoh, the extra `fleet`")

from zenoh_peers import Router, session

from slipd_client.fleet.fleet_listener import FleetListener

if TYPE_CHECKING:
    from conftest import Daemon, Publisher

PATIENCE_S = 60.0

Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def router() -> Iterator[Router]:
    with Router() as router:
        yield router


class Robot:
    """A daemon's publisher with a bridge."""

    def __init__(self, publisher: Publisher, slipctl: Start, router: Router, *more: str) -> None:
        self.publisher = publisher
        self.process = slipctl(
            *("--publish", publisher.endpoint, "serve", "fleet", "--fleet", "plant", "--robot", "arm3"),
            *("--connect", router.endpoint, *more),
        )
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == f"fleet: plant/arm3 at {router.endpoint}\n"
        self.heard = {publisher.wait_for_subscriber(), publisher.wait_for_subscriber()}
        self._seq = 0

    def sends(self, topic: str, **fields: Any) -> int:
        self._seq += 1
        self.publisher.send(topic, self._seq, **fields)
        return self._seq


@pytest.fixture
def robot(publisher: Publisher, slipctl: Start, router: Router) -> Robot:
    return Robot(publisher, slipctl, router)


def until(condition: Callable[[], Any]) -> Any:
    """Wait until a condition holds, and return its value."""
    end_s = time.monotonic() + PATIENCE_S
    while not (found := condition()):
        assert time.monotonic() < end_s, "it never came"
        time.sleep(0.02)
    return found


def state_of(listener: FleetListener) -> str:
    listener.take(0)
    return next((row.state for row in listener.state.rows(time.monotonic())), "")


class Alive:
    """Sends ``status`` while it is asked for something."""

    def __init__(self, robot: Robot, listener: FleetListener) -> None:
        self._robot, self._listener = robot, listener
        self._sent_s = 0.0

    def __call__(self) -> bool:
        if time.monotonic() > self._sent_s + 0.2:
            self._sent_s = time.monotonic()
            self._robot.sends("status", fingers={"left": {"level": "stable"}}, streams={})
        return state_of(self._listener) == "live"


def test_payloads_cross_unchanged_under_the_key_of_robot_and_topic(robot: Robot, router: Router) -> None:
    assert robot.heard == {b"", b"warning"}
    with session(router.endpoint) as here:
        heard: dict[str, bytes] = {}
        here.declare_subscriber("**", lambda sample: heard.update({str(sample.key_expr): sample.payload.to_bytes()}))
        sent = {topic: encode({"v": 1, "topic": topic}) for topic in ("warning", "slip.left", "wrench.left", "grasp")}

        def arrived() -> bool:
            for topic, payload in sent.items():
                robot.publisher.send_frames(topic.encode(), payload)
            return heard.keys() >= {f"plant/arm3/{topic}" for topic in sent}

        until(arrived)
        assert {key.removeprefix("plant/arm3/"): payload for key, payload in heard.items() if "@" not in key} == sent


def test_a_late_joiner_receives_the_last_values_and_kept_warnings(robot: Robot, router: Router) -> None:
    with session(router.endpoint) as here:
        early = FleetListener(here, "plant")
        until(Alive(robot, early))
        last = [robot.sends("warning") for _ in range(5)][-1]
        until(lambda: any(message.seq == last for message in early.take(0.05)))
        late = FleetListener(here, "plant")
        arrived: dict[str, list[int]] = {"status": [], "warning": []}

        def whole() -> bool:
            for message in late.take(0.05):
                arrived[message.topic].append(message.seq)
            return bool(arrived["status"]) and last in arrived["warning"]

        until(whole)
        assert arrived["warning"] == list(range(last - 4, last + 1))


def test_no_warning_is_lost_while_the_router_restarts(robot: Robot, router: Router) -> None:
    with session(router.endpoint) as here:
        listener = FleetListener(here, "plant")
        until(Alive(robot, listener))
        first = robot.sends("warning")
        until(lambda: any(message.seq == first for message in listener.take(0.05)))
        router.kill()
        until(lambda: state_of(listener) == "gone")
        sent = [robot.sends("warning") for _ in range(20)]
        router.start()
        arrived: list[int] = []

        def whole() -> bool:
            arrived.extend(message.seq for message in listener.take(0.05) if message.topic == "warning")
            return arrived == sent

        until(whole)
        until(Alive(robot, listener))
        assert [row.missed_warnings for row in listener.state.rows(0.0)] == [0]


def test_a_silent_daemon_and_a_bridge_that_dies_are_told_apart(robot: Robot, router: Router) -> None:
    with session(router.endpoint) as here:
        listener = FleetListener(here, "plant")
        until(Alive(robot, listener))
        until(lambda: state_of(listener) == "silent")
        assert robot.process.stderr is not None
        why = f"no message from {robot.publisher.endpoint} for 1.5 s. Is slipd running?"
        assert why in robot.process.stderr.readline()
        until(Alive(robot, listener))
        robot.process.kill()
        until(lambda: state_of(listener) == "gone")


def test_a_topic_that_comes_often_is_bounded_and_a_warning_is_not(robot: Robot, router: Router) -> None:
    with session(router.endpoint) as here:
        heard: dict[str, list[int]] = {"slip.left": [], "warning": []}

        def note(sample: Any) -> None:
            topic = str(sample.key_expr).rpartition("/")[2]
            heard.get(topic, []).append(decode(sample.payload.to_bytes())["seq"])

        here.declare_subscriber("plant/arm3/*", note)
        until(lambda: robot.sends("gripper") and robot.sends("slip.left") and heard["slip.left"])
        sent = [(robot.sends("slip.left"), robot.sends("warning")) for _ in range(200)]
        until(lambda: heard["slip.left"][-1] == sent[-1][0] and len(heard["warning"]) == 200)
        assert heard["warning"] == [seq for _, seq in sent]
        assert len(heard["slip.left"]) < 200


def test_nothing_that_the_fleet_sends_reaches_the_daemon(
    robot: Robot, router: Router, daemon: Daemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bridge subscribes and answers nothing but questions for kept messages; the daemon hears of no request."""
    request = encode({"v": 1, "id": 1, "op": "grip.set", "force_n": 5.0})
    with session(router.endpoint) as here:
        listener = FleetListener(here, "plant")
        until(Alive(robot, listener))
        for key in ("plant/arm3/grip.set", "plant/arm3/requests", "plant/arm3/warning"):
            here.put(key, request)
            assert [reply.ok for reply in here.get(key, payload=request, timeout=0.5)] == []
        until(Alive(robot, listener))
    assert daemon.requests == []
    assert not robot.publisher._socket.poll(50), "the bridge sends the daemon nothing but subscriptions"


def test_topics_are_chosen_and_status_is_always_among_them(
    publisher: Publisher, slipctl: Start, router: Router
) -> None:
    process = slipctl(
        *("--publish", publisher.endpoint, "serve", "fleet", "--fleet", "plant", "--robot", "arm3"),
        *("--connect", router.endpoint, "--topics", "slip", "grasp"),
    )
    assert {publisher.wait_for_subscriber() for _ in range(4)} == {b"warning", b"slip", b"grasp", b"status"}
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, "Traceback" in errors) == (130, False)


def test_wrong_arguments_are_refused(call: Callable[..., tuple[int, str, str]], tmp_path: Path) -> None:
    def refused(*arguments: str) -> str:
        code, _, errors = call(*arguments)
        assert code == 2
        return errors.removeprefix("slipctl: ").rpartition(" error: ")[2].strip()

    serve = ("serve", "fleet")
    assert refused(*serve).startswith("give --connect ENDPOINT, --listen ENDPOINT or --zenoh-config FILE")
    assert "argument --robot: the name must be 1 to 64" in refused(*serve, "--robot", "a/b")
    assert "argument --fleet: the name must be 1 to 64" in refused("fleet", "--fleet", "*")
    assert """must be a number, got 'fast'; "all" sets no bound""" in refused(*serve, "--rate", "fast")
    assert "must be from 0.001 to 1e6 Hz" in refused(*serve, "--rate", "0")
    for endpoint in ("nowhere", "tpc/10.0.0.1:7447", "tcp/10.0.0.1", "tcp/10.0.0.1:70000", "tcp/::1:7447", "tcp/:7447"):
        said = refused(*serve, "--connect", endpoint)
        assert said.startswith("argument --connect: must be like tcp/10.0.0.1:7447")
        assert said.endswith(f"got {endpoint!r}")
    assert 'Zenoh does not accept listen/endpoints ["tcp/h:1#"]' in refused("fleet", "--listen", "tcp/h:1#")
    with Router() as router:
        said = refused("fleet", "--listen", router.endpoint)
    assert said.startswith(f"Zenoh cannot start at {router.endpoint}: ")
    assert "Address already in use" in said
    assert ".rs:" not in said
    missing = str(tmp_path / "none.json5")
    assert f"{missing}: not a configuration of Zenoh" in refused("fleet", "--zenoh-config", missing)
