"""The server of messages for viewers, as a client that is not ours sees it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest
import replays
from foxglove_client import FoxgloveClient
from ros_peers import plain

from slipd_client.errors import CallError
from slipd_client.ros.conversion import TYPES, PadFrames, ros_messages
from slipd_client.viewers.viewers_command import ViewerServer

PADS = PadFrames({"left": {"positions": [[0.0, 0, 0, 0], [0.1, 0, 0.05, 0]], "quat_xyzw": [0, 0, 0, 1]}})
NAMES = {kind.full_name: name for name, kind in TYPES.items()}

Body = dict[str, Any]


@pytest.fixture(scope="module")
def published() -> dict[str, list[Body]]:
    """Bodies of the messages of a run, by topic."""
    found: dict[str, list[Body]] = {}
    for topic, body in replays.messages("demo"):
        found.setdefault(topic, []).append(body)
    return found


@pytest.fixture
def server() -> Iterator[ViewerServer]:
    server = ViewerServer("127.0.0.1", 0, PADS)
    yield server
    server.stop()


@pytest.fixture
def client(server: ViewerServer) -> Iterator[FoxgloveClient]:
    with FoxgloveClient(f"ws://127.0.0.1:{server.port}") as client:
        yield client


def test_channels_have_the_encodings_that_viewers_read(
    server: ViewerServer, client: FoxgloveClient, published: dict[str, list[Body]]
) -> None:
    for topic, bodies in published.items():
        server.publish(topic, bodies[-1])
    wanted = {each.topic: each.type for topic in published for each in ros_messages(topic, published[topic][-1], PADS)}
    client.subscribe(*wanted)
    assert {topic: NAMES[channel["schemaName"]] for topic, channel in client.channels.items()} == wanted
    assert {(each["encoding"], each["schemaEncoding"]) for each in client.channels.values()} == {("cdr", "ros2msg")}


def test_a_client_gets_the_last_message_with_its_own_time_and_then_every_other(
    server: ViewerServer, client: FoxgloveClient, published: dict[str, list[Body]]
) -> None:
    first, second, third = published["slip.left"][-3:]
    server.publish("slip.left", first)
    before_ns = time.time_ns()
    server.publish("slip.left", second)
    after_ns = time.time_ns()
    client.subscribe("/slipd/left/slip")
    last = client.receive()
    assert before_ns <= last.log_ns <= after_ns
    server.publish("slip.left", third)
    for found, body in ((last, second), (client.receive(), third)):
        (wanted, _) = ros_messages("slip.left", body)
        assert str(plain(found.message, NAMES[found.type])) == str(wanted.value)


def test_while_the_daemon_is_silent_a_client_sees_stale_diagnostics_and_no_last_message(
    server: ViewerServer, client: FoxgloveClient, published: dict[str, list[Body]]
) -> None:
    for topic in ("slip.left", "status"):
        server.publish(topic, published[topic][-1])
    server.silent("no message for 3 s")
    status = client.heard("status")
    assert (status["level"], status["message"]) == (1, "no message for 3 s")
    client.subscribe("/diagnostics", "/slipd/left/slip")
    stale = client.receive()
    assert stale.topic == "/diagnostics"
    assert {(entry.level, entry.message) for entry in stale.message.status} == {(3, "no message for 3 s")}
    server.alive()
    assert client.heard("removeStatus")["statusIds"] == [status["id"]]
    server.publish("slip.left", published["slip.left"][-1])
    assert client.receive().topic == "/slipd/left/slip"


def test_after_a_restart_of_the_daemon_nobody_gets_a_message_of_the_run_before(
    server: ViewerServer, client: FoxgloveClient, published: dict[str, list[Body]]
) -> None:
    server.silent("a silence before the first message")
    server.publish("slip.left", published["slip.left"][-2])
    server.restart()
    client.subscribe("/slipd/left/slip")
    server.publish("slip.left", published["slip.left"][-1])
    assert client.receive().message.seq == published["slip.left"][-1]["seq"]


def test_an_address_that_cannot_be_used_is_named(server: ViewerServer) -> None:
    with pytest.raises(CallError, match=rf"cannot serve viewers on 127.0.0.1:{server.port}: .*in use"):
        ViewerServer("127.0.0.1", server.port)
