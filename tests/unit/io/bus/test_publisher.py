"""Messages reach the subscribers of their topic, latecomers get the last one; a slow or rude one harms nobody."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import zmq
from heard_topics import Subscribe, hear
from loop_waits import PATIENCE_S
from zeromq_peers import StandingClock

from slipd.io.bus import publisher as publisher_module
from slipd.io.bus.publisher import Publisher
from slipd.io.zmtp import listener

if TYPE_CHECKING:
    from loop_waits import Eventually
    from zeromq_peers import Context, Peer

pytestmark = pytest.mark.usefixtures("loop_faults")


async def test_a_latecomer_alone_gets_the_last_message_of_its_topic_exactly_once(
    endpoint: str, subscribe: Subscribe, eventually: Eventually
) -> None:
    with Publisher(endpoint) as publisher:
        early = subscribe(b"slip.left")
        await hear(publisher, early, "slip.left", eventually)
        publisher.publish("slip.left", b"old")
        publisher.publish("slip.left", b"last")
        late = [subscribe(b"slip.left") for _ in range(5)]
        await eventually(lambda: all(each.got for each in late))
        publisher.publish("slip.left", b"next")
        await eventually(lambda: all(each.got[-1][1] == b"next" for each in [early, *late]))
    assert [frames[1] for frames in early.got] == [b"old", b"last", b"next"]
    assert [[frames[1] for frames in each.got] for each in late] == [[b"last", b"next"]] * 5


async def test_a_latecomer_gets_the_last_message_of_every_topic_it_subscribed_to_and_of_no_other(
    endpoint: str, subscribe: Subscribe, eventually: Eventually
) -> None:
    with Publisher(endpoint) as publisher:
        early = subscribe(b"")
        await hear(publisher, early, "status", eventually)
        for topic in ("slip.left", "grasp", "slip.right", "slip.thumb", "warning"):
            publisher.publish(topic, f"last {topic}".encode())
        await eventually(lambda: len(early.got) == 5)
        late = subscribe(b"slip", b"warning", b"slip.left")  # the last of them is within the first
        await eventually(lambda: len(late.got) == 4)
        publisher.publish("warning", b"new")
        await eventually(lambda: len(late.got) == 5)
        await eventually(lambda: len(early.got) == 6)  # what the latecomer got came to nobody else
    assert late.got == [
        [b"slip.left", b"last slip.left"],
        [b"slip.right", b"last slip.right"],
        [b"slip.thumb", b"last slip.thumb"],
        [b"warning", b"last warning"],
        [b"warning", b"new"],
    ]


async def test_a_latecomer_gets_the_last_message_of_each_finger_that_shares_the_topic(
    endpoint: str, subscribe: Subscribe, eventually: Eventually
) -> None:
    with Publisher(endpoint) as publisher:
        for finger in ("left", "right", "left"):
            publisher.publish("warning", f"{finger} {publisher.published}".encode(), finger)
        late = subscribe(b"warning")
        await eventually(lambda: len(late.got) == 2)
    assert late.got == [[b"warning", b"right 1"], [b"warning", b"left 2"]]


async def test_who_unsubscribes_gets_no_more(endpoint: str, peer: Callable[..., Peer], eventually: Eventually) -> None:
    with Publisher(endpoint) as publisher:
        raw = peer(zmq.XSUB, endpoint)  # unlike SUB, it does not filter by itself
        raw.socket.send(b"\x01slip")
        raw.socket.send(b"\x01end")
        await hear(publisher, raw, "slip.left", eventually)
        raw.socket.send(b"\x00slip")
        raw.socket.send(b"\x01heard")
        publisher.publish("heard", b"")
        await eventually(lambda: [b"heard", b""] in raw.got)
        raw.got.clear()
        publisher.publish("slip.left", b"unwanted")
        publisher.publish("end", b"")
        await eventually(lambda: raw.got)
    assert raw.got == [[b"end", b""]]


async def test_Z1_a_subscriber_that_never_reads_costs_the_others_nothing(
    endpoint: str, subscribe: Subscribe, eventually: Eventually
) -> None:
    with Publisher(endpoint) as publisher:
        stalled = subscribe(b"", RCVHWM=1)
        reader = subscribe(b"")
        await eventually(lambda: publisher.publish("slip.left", b"") or (stalled.socket.poll(0) and reader.got))
        reader.got.clear()
        for number in range(10_000):
            publisher.publish("tactile.left", number.to_bytes(4, "big") * 500)
            if number % 100 == 99:
                await eventually(lambda: len(reader.got) > number)  # noqa: B023
    assert [int.from_bytes(payload[:4], "big") for topic, payload in reader.got if topic == b"tactile.left"] == list(
        range(10_000)
    )
    assert 0 < len(stalled.got) < 10_000


async def test_the_last_messages_before_the_stop_arrive(
    endpoint: str, subscribe: Subscribe, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listener, "LINGER_S", PATIENCE_S)  # a busy machine may need more than a tenth of a second
    context: Context = zmq.Context()
    with Publisher(endpoint) as publisher:
        subscriber = subscribe(b"")
        await hear(publisher, subscriber, "status", eventually)
        for _ in range(900):
            publisher.publish("status", bytes(4000))
    await asyncio.to_thread(context.term)
    await eventually(lambda: len(subscriber.got) == 900)


async def test_a_stalled_subscriber_does_not_keep_the_daemon_from_ending(
    endpoint: str, subscribe: Subscribe, eventually: Eventually
) -> None:
    context: Context = zmq.Context()
    with Publisher(endpoint) as publisher:
        stalled = subscribe(b"", RCVHWM=1)
        await eventually(lambda: publisher.publish("status", b"") or stalled.socket.poll(0))
        for _ in range(3000):
            publisher.publish("status", bytes(2000))
    await asyncio.to_thread(context.term)


@pytest.mark.parametrize("garbage", [b"", b"\x07hello", b"\x01" + bytes(300), b"\xff" * 1_000_000])
async def test_invalid_messages_of_a_subscriber_harm_nobody(
    garbage: bytes,
    endpoint: str,
    subscribe: Subscribe,
    peer: Callable[..., Peer],
    eventually: Eventually,
) -> None:
    with Publisher(endpoint) as publisher:
        rude = peer(zmq.XSUB, endpoint)
        for _ in range(10):
            rude.socket.send(garbage)
            rude.socket.send_multipart([garbage, garbage])
        early = subscribe(b"slip")
        await hear(publisher, early, "slip.left", eventually)


@pytest.mark.parametrize(
    "flood",
    [
        [b"\x01%d" % number for number in range(5000)],
        [b"\x01same"] * 5000,
        [b"\x01come", b"\x00come"] * 2500,
        [b"\x07hello"] * 5000,
    ],
    ids=["different", "same", "back and forth", "none"],
)
async def test_a_client_that_floods_subscriptions_is_disconnected_and_no_other(
    flood: list[bytes],
    endpoint: str,
    subscribe: Subscribe,
    peer: Callable[..., Peer],
    eventually: Eventually,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(publisher_module, "time", StandingClock)
    with Publisher(endpoint) as publisher:
        early = subscribe(b"slip")
        await hear(publisher, early, "slip.left", eventually)
        gone = early.socket.get_monitor_socket(zmq.EVENT_DISCONNECTED)
        rude = peer(zmq.XSUB, endpoint, RECONNECT_IVL=-1, SNDHWM=0)
        monitor = rude.socket.get_monitor_socket(zmq.EVENT_DISCONNECTED)
        for message in flood:
            rude.socket.send(message)
        await eventually(lambda: monitor.poll(0))
        assert publisher.subscriptions <= 1 + publisher_module.MOST_SUBSCRIPTIONS
        publisher.publish("slip.left", b"still there")
        await eventually(lambda: early.got)
        assert not gone.poll(0)
        for each in (rude, early):
            each.socket.disable_monitor()
        monitor.close()
        gone.close()


async def test_the_longest_subscription_is_served_and_a_longer_one_ends_the_connection(
    endpoint: str, subscribe: Subscribe, eventually: Eventually
) -> None:
    """libzmq sends it as a command of ZMTP 3.1, which is longer than the message of ZMTP 3.0."""
    longest = "x" * publisher_module.MAX_PREFIX_BYTES
    with Publisher(endpoint) as publisher:
        await hear(publisher, subscribe(longest.encode(), RECONNECT_IVL=-1), longest, eventually)
        beyond = subscribe(f"{longest}y".encode())
        monitor = beyond.socket.get_monitor_socket(zmq.EVENT_DISCONNECTED)
        await eventually(lambda: monitor.poll(0))
        beyond.socket.disable_monitor()
        monitor.close()


async def test_Z2_a_storm_of_reconnections_leaks_nothing(
    endpoint: str, clients: Context, subscribe: Subscribe, eventually: Eventually
) -> None:
    def open_files() -> int:
        return len(list(Path("/proc/self/fd").iterdir()))

    with Publisher(endpoint) as publisher:
        publisher.publish("slip.left", b"last")
        staying = subscribe(b"slip.left")
        await eventually(lambda: staying.got)
        before = open_files()
        for cycle in range(300):
            subscriber = subscribe(b"slip.left")
            if cycle % 10 == 0:
                await eventually(lambda: subscriber.got)  # noqa: B023
                assert subscriber.got == [[b"slip.left", b"last"]]
            subscriber.socket.close()
        await eventually(lambda: open_files() <= before)
