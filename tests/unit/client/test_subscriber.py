from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest
import zmq

from slipd_client.errors import Silence
from slipd_client.messages import encode
from slipd_client.messages.typed import Message, Slip, SlipLevel
from slipd_client.subscriber import Subscriber

if TYPE_CHECKING:
    from conftest import Publisher

PATIENCE_S = 60.0

NEW = {"v": 1, "seq": 2, "boot": "boot-1", "t_ns": 1}


def heard(subscriber: Subscriber) -> Message:
    message = subscriber.receive(PATIENCE_S)
    assert message is not None, f"nothing came; {subscriber.bad} unreadable: {subscriber.bad_reason}"
    return message


def hear_nothing(subscriber: Subscriber, until: Callable[[], bool]) -> None:
    """Receive until something is so, without any message."""
    until_s = time.monotonic() + PATIENCE_S
    while not until():
        assert subscriber.receive(0.02) is None
        assert time.monotonic() < until_s


def test_a_message_arrives_with_its_topic_and_fields(publisher: Publisher) -> None:
    with Subscriber(publisher.endpoint) as subscriber:
        assert publisher.wait_for_subscriber() == b"slip"
        publisher.send("slip.left", 7, level="stable", spin_nm=None)
        message = heard(subscriber)
    assert isinstance(message, Slip)
    assert (message.topic, message.level, message.spin_nm) == ("slip.left", SlipLevel.STABLE, None)
    assert message.raw["level"] == message.level
    assert (message.missed, message.restarted) == (0, False)


def test_a_display_gets_the_newest_message_of_each_topic(publisher: Publisher) -> None:
    with Subscriber(publisher.endpoint, ["slip", "gripper", "warning"]) as subscriber:
        assert subscriber.newest() == []
        publisher.wait_for(b"warning")
        publisher.send("warning", 0)
        heard(subscriber)
        for topic, seq in (("slip.left", 1), ("slip.right", 1), ("slip.left", 2), ("slip.left", 5), ("warning", 1)):
            publisher.send(topic, seq)
        publisher.send_frames(b"gripper", b"\xc1 no message")
        found: dict[str, Message] = {}
        until = time.monotonic() + PATIENCE_S
        while "warning" not in found and time.monotonic() < until:
            found |= {message.topic: message for message in subscriber.newest()}
        assert {topic: message.seq for topic, message in found.items()} == {
            "slip.right": 1,
            "slip.left": 5,
            "warning": 1,
        }
        assert subscriber.newest() == []


@pytest.mark.parametrize(
    ("topics", "sent", "expected"),
    [
        (["warning"], [("slip.left", 1), ("warning", 1)], [("warning", 1, 0)]),
        (["sta"], [("slip.left", 1), ("status", 1)], [("status", 1, 0)]),
        (
            ["slip"],
            [("slip.left", 5), ("slip.right", 90), ("slip.left", 9), ("slip.right", 91)],
            [("slip.left", 5, 0), ("slip.right", 90, 0), ("slip.left", 9, 3), ("slip.right", 91, 0)],
        ),
        (["slip"], [("slip.left", seq) for seq in (3, 3, 2, 4)], [("slip.left", 3, 0), ("slip.left", 4, 0)]),
    ],
)
def test_the_chosen_topics_are_heard_once_each_with_its_gaps(
    publisher: Publisher, topics: list[str], sent: list[tuple[str, int]], expected: list[tuple[str, int, int]]
) -> None:
    with Subscriber(publisher.endpoint, topics) as subscriber:
        publisher.wait_for(topics[0].encode())
        for topic, seq in sent:
            publisher.send(topic, seq)
        told = [heard(subscriber) for _ in expected]
    assert [(message.topic, message.seq, message.missed) for message in told] == expected


def test_a_restart_is_told_once_and_is_no_gap(start_publisher: Callable[..., Publisher]) -> None:
    old = start_publisher()
    with Subscriber(old.endpoint) as subscriber:
        old.wait_for_subscriber()
        old.send("slip.left", 500)
        assert not heard(subscriber).restarted
        old.close()
        new = start_publisher(boot="boot-2")
        new.wait_for_subscriber(meanwhile=lambda: subscriber.receive(0.02))
        new.send("slip.left", 1)
        new.send("slip.right", 1)
        new.send("slip.left", 2)
        told = [heard(subscriber) for _ in range(3)]
    assert [message.restarted for message in told] == [True, False, False]
    assert [message.missed for message in told] == [0, 0, 0]


@pytest.mark.parametrize(
    ("frames", "reason"),
    [
        pytest.param((b"slip.left",), "two frames", id="one frame"),
        pytest.param((b"slip.left", b"\x80", b"\x80"), "two frames", id="three frames"),
        pytest.param((b"slip.\xff", b"\x80"), "topic", id="a topic that is no text"),
        pytest.param((b"slip.left", b"\xc1"), "malformed", id="no msgpack"),
        pytest.param((b"slip.left", encode({"v": 1, "x": float("nan")})), "not_finite", id="NaN"),
        pytest.param((b"slip.left", b"\x80"), "unsupported_version", id="an empty map"),
        pytest.param((b"slip.left", encode({"v": 2, "seq": 1, "boot": "b", "t_ns": 1})), "v must be 1", id="version"),
        pytest.param((b"slip.left", encode({"v": 1, "seq": "1", "boot": "b", "t_ns": 1})), "seq", id="seq"),
        pytest.param((b"slip.left", encode({"v": 1, "seq": 1, "boot": 4, "t_ns": 1})), "boot", id="boot"),
        pytest.param((b"slip.left", encode({"v": 1, "seq": 1, "boot": "b"})), "t_ns", id="t_ns"),
        pytest.param((b"slip.left", encode(NEW | {"finger": "left", "level": "fine"})), "fine", id="level"),
    ],
)
def test_an_unreadable_message_is_counted_and_the_next_is_heard(
    publisher: Publisher, frames: tuple[bytes, ...], reason: str
) -> None:
    with Subscriber(publisher.endpoint) as subscriber:
        publisher.wait_for_subscriber()
        publisher.send("slip.left", 1)
        publisher.send_frames(*frames)
        publisher.send("slip.left", 3)
        told = [heard(subscriber) for _ in range(2)]
        assert [(message.seq, message.missed) for message in told] == [(1, 0), (3, 1)]
        assert subscriber.bad == 1
        assert reason in subscriber.bad_reason


def test_a_message_makes_it_fresh_until_its_age_passes_the_limit(publisher: Publisher) -> None:
    with Subscriber(publisher.endpoint, silence_s=60.0) as subscriber:
        publisher.wait_for_subscriber()
        publisher.send("slip.left", 1)
        assert 0.0 <= heard(subscriber).age_s < 60.0
        assert not subscriber.stale
        subscriber._tracker.silence_s = 0.0
        assert subscriber.stale
        subscriber._tracker.silence_s = None
        assert not subscriber.stale


def test_silence_is_told_with_why_nothing_could_be_read(publisher: Publisher) -> None:
    with Subscriber(publisher.endpoint, silence_s=0.2) as subscriber:
        publisher.wait_for_subscriber()
        publisher.send("slip.left", 1, v=2)
        hear_nothing(subscriber, until=lambda: subscriber.bad == 1)
        with pytest.raises(Silence, match="1 could not be read, the last: unsupported_version"):
            next(iter(subscriber))


def test_status_is_a_sign_of_life_that_only_those_get_who_asked_for_it(publisher: Publisher) -> None:
    with Subscriber(publisher.endpoint, ["warning"], silence_s=PATIENCE_S) as subscriber:
        assert {publisher.wait_for_subscriber(), publisher.wait_for_subscriber()} == {b"warning", b"status"}
        publisher.send("status", 1)
        hear_nothing(subscriber, until=lambda: not subscriber.stale)
        publisher.send("warning", 1)
        assert heard(subscriber).topic == "warning"


def test_a_restart_that_only_the_sign_of_life_told_is_told_by_the_next_message(publisher: Publisher) -> None:
    with Subscriber(publisher.endpoint) as subscriber:
        for _ in range(2):
            publisher.wait_for_subscriber()
        publisher.send("slip.left", 5)
        publisher.boot = "boot-2"
        publisher.send("status", 1)
        publisher.send("slip.left", 3)
        publisher.send("slip.left", 4)
        assert [heard(subscriber).restarted for _ in range(3)] == [False, True, False]


def test_a_daemon_that_dies_behind_a_backlog_does_not_take_its_subscribers_along(publish: str) -> None:
    """ZeroMQ's heartbeats abort the process then; the kernel's keepalive does not."""
    with Subscriber(publish) as subscriber:
        assert subscriber._link.socket.getsockopt(zmq.HEARTBEAT_IVL) == 0
        assert subscriber._link.socket.getsockopt(zmq.TCP_KEEPALIVE) == 1
