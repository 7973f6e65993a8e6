from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable

import pytest
import zmq
from client_peers import PATIENCE_S, Publisher, until

from slipd_client.aio import AsyncSubscriber
from slipd_client.errors import Silence
from slipd_client.messages import encode
from slipd_client.messages.typed import Message
from slipd_client.subscriber import Subscriber

NEW = {"v": 1, "seq": 2, "boot": "boot-1", "t_ns": 1}


def heard(subscriber: Subscriber) -> Message:
    message = subscriber.receive(PATIENCE_S)
    assert message is not None, f"nothing came; {subscriber.bad} unreadable: {subscriber.bad_reason}"
    return message


def hear_nothing_until(condition: Callable[[], bool], subscriber: Subscriber) -> None:
    def hear_nothing() -> None:
        assert subscriber.receive(0.02) is None

    until(condition, hear_nothing)


def test_a_display_gets_the_newest_message_of_each_topic(publisher: Publisher) -> None:
    with Subscriber(publisher.endpoint, ["slip", "gripper", "warning"]) as subscriber:
        assert subscriber.newest() == []
        publisher.wait_for(b"warning")
        publisher.send("warning", 0)
        heard(subscriber)
        for topic, seq in (("slip.left", 1), ("slip.right", 1), ("slip.left", 2), ("slip.left", 5), ("warning", 1)):
            publisher.send(topic, seq)
        publisher.send_frames(b"gripper", b"\xc1 no message")
        found: dict[str, int] = {}
        until(lambda: "warning" in found, lambda: found.update({each.topic: each.seq for each in subscriber.newest()}))
        assert found == {"slip.right": 1, "slip.left": 5, "warning": 1}
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


@pytest.mark.parametrize(
    ("frames", "reason"),
    [
        pytest.param((b"slip.left",), "two frames", id="one frame"),
        pytest.param((b"slip.left", b"\x80", b"\x80"), "two frames", id="three frames"),
        pytest.param((b"slip.\xff", b"\x80"), "topic", id="a topic that is no text"),
        pytest.param((b"slip.left", b"\xc1"), "malformed", id="no msgpack"),
        pytest.param((b"slip.left", encode({"v": 1, "x": float("nan")})), "not_finite", id="NaN"),
        pytest.param((b"slip.left", b"\x80"), "unsupported_version", id="an empty map"),
        pytest.param(
            (b"slip.left", encode({"v": 2, "seq": 1, "boot": "b", "t_ns": 1})),
            "the version of the API must be 1",
            id="version",
        ),
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
        publisher.wait_for(b"slip")
        publisher.send("slip.left", 1)
        publisher.send_frames(*frames)
        publisher.send("slip.left", 3)
        told = [heard(subscriber) for _ in range(2)]
        assert [(message.seq, message.missed) for message in told] == [(1, 0), (3, 1)]
        assert subscriber.bad == 1
        assert reason in subscriber.bad_reason


def test_a_message_makes_it_fresh_until_its_age_passes_the_limit(publisher: Publisher) -> None:
    with Subscriber(publisher.endpoint, silence_s=60.0) as subscriber:
        publisher.wait_for(b"slip")
        publisher.send("slip.left", 1)
        assert 0.0 <= heard(subscriber).age_s < 60.0
        for limit_s, stale in ((60.0, False), (0.0, True), (None, False)):
            subscriber._silence_s = limit_s
            assert subscriber.stale is stale


def test_silence_is_told_with_why_nothing_could_be_read(publisher: Publisher) -> None:
    with Subscriber(publisher.endpoint, silence_s=0.2) as subscriber:
        publisher.wait_for(b"slip")
        publisher.send("slip.left", 1, v=2)
        hear_nothing_until(lambda: subscriber.bad == 1, subscriber)
        with pytest.raises(Silence, match="1 could not be read, the last: unsupported_version"):
            next(iter(subscriber))


def test_status_is_a_sign_of_life_that_only_those_get_who_asked_for_it(publisher: Publisher) -> None:
    with Subscriber(publisher.endpoint, ["warning"], silence_s=PATIENCE_S) as subscriber:
        publisher.wait_for(b"warning", b"status")
        assert publisher.topics == {b"warning", b"status"}
        publisher.send("status", 1)
        hear_nothing_until(lambda: not subscriber.stale, subscriber)


def test_a_restart_is_told_once_and_is_no_gap_also_if_only_the_sign_of_life_told_it(publisher: Publisher) -> None:
    with Subscriber(publisher.endpoint) as subscriber:
        publisher.wait_for(b"slip", b"status")
        publisher.send("slip.left", 500)
        for boot, topics in (("boot-2", ("status", "slip.left", "slip.left")), ("boot-3", ("slip.left", "slip.right"))):
            publisher.boot = boot
            for seq, topic in enumerate(topics, start=1):
                publisher.send(topic, seq)
        told = [heard(subscriber) for _ in range(5)]
    assert [(message.restarted, message.missed) for message in told] == [
        *((False, 0), (True, 0), (False, 0)),
        *((True, 0), (False, 0)),
    ]


def test_a_cut_cable_is_noticed_within_three_seconds_by_the_kernel(publish: str) -> None:
    """ZeroMQ's own heartbeats abort the process when a daemon dies behind a backlog."""
    with Subscriber(publish) as subscriber:
        on, idle_s, interval_s, count, longest_ms, heartbeat = map(
            subscriber._link.socket.getsockopt,
            (
                *(zmq.TCP_KEEPALIVE, zmq.TCP_KEEPALIVE_IDLE, zmq.TCP_KEEPALIVE_INTVL, zmq.TCP_KEEPALIVE_CNT),
                *(zmq.TCP_MAXRT, zmq.HEARTBEAT_IVL),
            ),
        )
        assert (on, idle_s + interval_s * count, longest_ms, heartbeat) == (1, 3, 3000, 0)


async def test_no_message_is_lost_by_cancelled_receives(publisher: Publisher) -> None:
    """Every wait is cancelled or runs out in the midst of a stream; all messages come, in order, once."""
    count, heard = 500, []

    async def send() -> None:
        for seq in range(count):
            publisher.send("slip.left", seq)
            if seq % 3 == 0:
                await asyncio.sleep(0.0005)

    async with AsyncSubscriber(publisher.endpoint) as subscriber:
        await asyncio.to_thread(publisher.wait_for, b"slip")
        sender = asyncio.create_task(send())
        async with asyncio.timeout(PATIENCE_S * 3):
            while len(heard) < count:
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(0.0007):
                        while True:
                            message = await subscriber.receive()
                            heard.append((message.seq, message.missed))
        await sender
    assert heard == [(seq, 0) for seq in range(count)]
