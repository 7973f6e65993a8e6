"""``slipctl serve fleet`` as a process, between a publishing daemon and a real router, and what a view receives."""

from __future__ import annotations

import signal
import socket
import subprocess
import time
from collections.abc import Callable
from typing import Any

import pytest
import zenoh
from client_peers import PATIENCE_S, Publisher, until
from zenoh_peers import Router, session

from slipd_client.fleet import fleet_network
from slipd_client.fleet.fleet_network import FairQueue, FleetListener
from slipd_client.fleet.robot_bridge import BridgePublisher
from slipd_client.messages import decode, encode

Start = Callable[..., "subprocess.Popen[str]"]
FLOOD = 3_000


@pytest.fixture
def bridge(publisher: Publisher, slipctl: Start, router: Router) -> Any:
    """The bridge of arm3, once it listens to its daemon."""
    process = slipctl(
        *("--publish", publisher.endpoint, "serve", "fleet"),
        *("--fleet", "plant", "--robot", "arm3", "--connect", router.endpoint),
    )
    assert process.stdout.readline() == f"fleet: plant/arm3 at {router.endpoint}\n"
    publisher.wait_for(b"", b"warning")
    return process


def wait_for_state(listener: FleetListener, state: str, publisher: Publisher | None = None) -> None:
    """Wait until a view shows the robot in a state; ``publisher``: its daemon reports meanwhile."""

    def shown() -> bool:
        listener.receive(0)
        return [row.state for row in listener.state.rows(time.monotonic())] == [state]

    def report() -> None:
        if publisher:
            publisher.send("status", fingers={"left": {"level": "stable"}}, streams={})
            time.sleep(0.05)

    until(shown, report)


def numbers(listener: FleetListener, found: list[int]) -> list[int]:
    """Add the numbers of the warnings that have arrived at a view, and return all of them."""
    found += [message.seq for message in listener.receive(0.05) if message.topic == "warning"]
    return found


@pytest.mark.usefixtures("bridge")
def test_payloads_cross_unchanged_under_the_key_of_robot_and_topic(publisher: Publisher, router: Router) -> None:
    sent = {f"plant/arm3/{topic}": encode({"v": 1, "topic": topic}) for topic in ("warning", "slip.left", "grasp")}
    with session(router.endpoint) as here:
        heard: dict[str, bytes] = {}
        here.declare_subscriber("*/*/*", lambda sample: heard.update({str(sample.key_expr): sample.payload.to_bytes()}))

        def send() -> None:
            for key, payload in sent.items():
                publisher.send_frames(key.rpartition("/")[2].encode(), payload)

        until(lambda: heard == sent, send)


@pytest.mark.usefixtures("bridge")
def test_no_warning_is_lost_while_the_router_restarts(publisher: Publisher, router: Router) -> None:
    with session(router.endpoint) as here:
        listener = FleetListener(here, "plant")
        wait_for_state(listener, "live", publisher)
        sent, arrived = [publisher.send("warning")], []
        until(lambda: numbers(listener, arrived) == sent)
        router.kill()
        wait_for_state(listener, "gone")
        sent += [publisher.send("warning") for _ in range(20)]
        router.start()
        until(lambda: numbers(listener, arrived) == sent)
        wait_for_state(listener, "live", publisher)
        assert [row.missed_warnings for row in listener.state.rows(0.0)] == [0]


def test_the_silence_of_its_daemon_is_said_here_and_to_the_fleet(
    bridge: Any, publisher: Publisher, router: Router
) -> None:
    with session(router.endpoint) as here:
        listener = FleetListener(here, "plant")
        wait_for_state(listener, "live", publisher)
        assert f"no message from {publisher.endpoint} for 1.5 s. Is slipd running?" in bridge.stderr.readline()
        until(lambda: [str(each.ok.key_expr) for each in here.liveliness().get("plant/**")] == ["plant/arm3/bridge"])
        wait_for_state(listener, "silent")


@pytest.mark.usefixtures("bridge")
def test_a_topic_that_comes_often_is_bounded_and_a_warning_is_not(publisher: Publisher, router: Router) -> None:
    heard: dict[str, list[int]] = {"slip.left": [], "warning": [], "gripper": []}

    def note(sample: Any) -> None:
        heard[str(sample.key_expr).rpartition("/")[2]].append(decode(sample.payload.to_bytes())["seq"])

    with session(router.endpoint) as here:
        here.declare_subscriber("plant/arm3/*", note)
        until(lambda: heard["slip.left"], lambda: (publisher.send("gripper"), publisher.send("slip.left")))
        sent = [(publisher.send("slip.left"), publisher.send("warning")) for _ in range(200)]
        until(lambda: heard["slip.left"][-1] == sent[-1][0] and len(heard["warning"]) == 200)
        assert (heard["warning"], len(heard["slip.left"]) < 200) == ([seq for _, seq in sent], True)


@pytest.mark.usefixtures("bridge")
def test_nothing_that_the_fleet_sends_reaches_the_daemon(publisher: Publisher, router: Router) -> None:
    """The bridge has one connection to the daemon, which subscribes; it answers questions for kept messages alone."""
    request = encode({"v": 1, "id": 1, "op": "grip.set", "force_n": 5.0})
    with session(router.endpoint) as here:
        listener = FleetListener(here, "plant")
        wait_for_state(listener, "live", publisher)
        for key in ("plant/arm3/grip.set", "plant/arm3/requests", "plant/arm3/warning"):
            here.put(key, request)
            assert [reply.ok for reply in here.get(key, payload=request, timeout=0.1)] == []
        wait_for_state(listener, "live", publisher)
    assert publisher.subscribed() == {b"", b"warning"}


def test_topics_are_chosen_and_status_is_always_among_them(
    publisher: Publisher, slipctl: Start, router: Router
) -> None:
    process = slipctl(
        *("--publish", publisher.endpoint, "serve", "fleet", "--robot", "arm3"),
        *("--connect", router.endpoint, "--topics", "slip", "grasp"),
    )
    until(lambda: publisher.subscribed() == {b"warning", b"slip", b"grasp", b"status"})
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, "Traceback" in errors) == (130, False)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ("serve fleet", "give --connect ENDPOINT, --listen ENDPOINT or --zenoh-config FILE"),
        ("serve fleet --robot a/b", "argument --robot: must be 1 to 64"),
        ("fleet --fleet *", "argument --fleet: must be 1 to 64"),
        ("serve fleet --rate fast", "must be a number, got 'fast'"),
        ("serve fleet --rate 0", "must be from 0.001 to 1e6 Hz"),
        *(
            (f"serve fleet --connect {endpoint}", "argument --connect: must be like tcp/10.0.0.1:7447")
            for endpoint in ("here", "tpc/10.0.0.1:7447", "tcp/10.0.0.1", "tcp/h:65536", "tcp/::1:7447", "tcp/:7447")
        ),
        ("fleet --listen tcp/h:1#", 'Zenoh does not accept listen/endpoints ["tcp/h:1#"]'),
        ("fleet --listen USED", "slipctl: Zenoh cannot start at USED: "),
        ("fleet --listen USED", "Address already in use"),
        ("fleet --zenoh-config /no/such.json5", "/no/such.json5: not a configuration of Zenoh"),
    ],
)
def test_wrong_arguments_are_refused(arguments: str, complaint: str, call: Callable[..., tuple[int, str, str]]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        used = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        code, _, errors = call(*arguments.replace("USED", used).split())
    assert (code, complaint.replace("USED", used) in errors, ".rs:" in errors) == (2, True, False)


def warning(seq: int, boot: str) -> bytes:
    body = {"finger": "left", "level": "slipping", "previous": "stable", "rising": True, "utilisation": None}
    return encode({"v": 1, "seq": seq, "boot": boot, "t_ns": seq} | body)


def arrive(publisher: zenoh.Session, view: zenoh.Session, name: str) -> None:
    """Wait until all that a session has published has arrived at the session of the view."""
    with_order = {"priority": zenoh.Priority.INTERACTIVE_HIGH, "congestion_control": zenoh.CongestionControl.BLOCK}
    with view.declare_subscriber(f"arrived/{name}", zenoh.handlers.FifoChannel(1)) as arrived:
        # again and again: the router may not know of the subscriber yet
        until(lambda: arrived.try_recv() is not None, lambda: publisher.put(f"arrived/{name}", b"", **with_order))


def test_Z9_an_alarm_is_read_before_the_flood_that_came_first(router: Router, monkeypatch: pytest.MonkeyPatch) -> None:
    """One look has time for all that arrived, however slow the machine is; the alarm arrived last."""
    with session(router.endpoint) as here, session(router.endpoint) as other, session(router.endpoint) as hostile:
        view = FleetListener(here, "slipd")
        honest, flood = BridgePublisher(other, "slipd", "honest"), BridgePublisher(hostile, "slipd", "flood")
        until(lambda: len(view.state.rows(0.0)) == 2, lambda: view.receive(0.05))
        for seq in range(1, FLOOD + 1):
            flood.put("warning", warning(seq, "flood"))
        arrive(hostile, here, "flood")
        honest.put("warning", warning(1, "honest"))
        arrive(other, here, "honest")
        monkeypatch.setattr(fleet_network, "WORK_S", PATIENCE_S)
        boots = [message.raw["boot"] for message in view.receive(0.05)]
        assert boots.index("honest") <= 2
        assert boots.count("flood") > FLOOD / 2


def test_each_peer_has_its_turn_and_its_share() -> None:
    queue: FairQueue[str] = FairQueue(share=3, most_peers=2)
    displaced = [queue.add(item[0], item) for item in ("a0", "a1", "a2", "a3", "b0", "c0", "d0")]
    found = [queue.pop() for _ in range(6)]
    assert (displaced.index(True), sum(displaced), bool(queue)) == (3, 1, False)
    assert found == ["a1", "b0", "c0", "a2", "d0", "a3"], "c and d share one queue"
