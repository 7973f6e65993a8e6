"""Subscribers that send too much, subscribe to too much or reconnect too often harm neither publisher nor others."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import zmq
from heard_topics import Subscribe, hear

from slipd.io.bus import publisher as publisher_module
from slipd.io.bus.publisher import Publisher

if TYPE_CHECKING:
    from loop_waits import Eventually
    from zeromq_peers import Context, Peer

pytestmark = pytest.mark.usefixtures("loop_faults")


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


async def test_a_subscriber_that_sends_a_huge_message_is_disconnected(
    endpoint: str, peer: Callable[..., Peer], eventually: Eventually
) -> None:
    with Publisher(endpoint):
        rude = peer(zmq.XSUB, endpoint, RECONNECT_IVL=-1)
        monitor = rude.socket.get_monitor_socket(zmq.EVENT_DISCONNECTED)
        rude.socket.send(bytes(publisher_module.MAX_PREFIX_BYTES + 1))
        rude.socket.send(b"\x07" * (publisher_module.MAX_PREFIX_BYTES + 2))
        await eventually(lambda: monitor.poll(0))
        rude.socket.disable_monitor()
        monitor.close()


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
) -> None:
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


async def test_many_clients_may_each_have_the_most_subscriptions(
    endpoint: str, subscribe: Subscribe, eventually: Eventually
) -> None:
    most = publisher_module.MOST_SUBSCRIPTIONS
    topics = [f"{number:02d}.{'x' * 60}" for number in range(most)]
    with Publisher(endpoint) as publisher:
        for _ in range(3):
            subscribers = [subscribe(*(topic.encode() for topic in topics)) for _ in range(3)]
            for each in subscribers:
                each.socket.setsockopt(zmq.UNSUBSCRIBE, topics[0].encode())
                each.socket.setsockopt(zmq.SUBSCRIBE, b"end")
                await hear(publisher, each, "end", eventually)
            publisher.publish(topics[-1], b"heard")
            await eventually(lambda: all([topics[-1].encode(), b"heard"] in each.got for each in subscribers))  # noqa: B023
            for each in subscribers:
                each.socket.close()


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


async def test_a_new_subscription_checks_only_its_own_client(
    endpoint: str, subscribe: Subscribe, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked: list[bytes] = []

    def count(wanted: set[bytes], topic: bytes) -> bool:
        looked.append(topic)
        return any(map(topic.startswith, wanted))

    with Publisher(endpoint) as publisher:
        others = [subscribe(b"slip") for _ in range(5)]
        for each in others:
            await hear(publisher, each, "slip.left", eventually)
        restless = subscribe(b"slip")
        await hear(publisher, restless, "slip.left", eventually)
        monkeypatch.setattr(publisher_module, "_wants", count)
        restless.socket.setsockopt(zmq.UNSUBSCRIBE, b"slip")
        await eventually(lambda: publisher.subscriptions == len(others))
        publisher.publish("slip.left", b"to the others")
        await eventually(lambda: all([b"slip.left", b"to the others"] in each.got for each in others))
    assert looked == [b"slip.left"]
    assert restless.got == []


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
