"""Messages reach the subscribers of their topic, latecomers get the last one; a slow or rude one harms nobody."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import pytest
import zmq
from loop_waits import PATIENCE_S, eventually, open_files
from zeromq_peers import Clients, Peer, StandingClock

from slipd.io import publisher as publisher_module
from slipd.io.publisher import Publisher
from slipd.io.zmtp import listener

pytestmark = pytest.mark.usefixtures("loop_faults")

Subscribe = Callable[..., Peer]
NUMBERS = itertools.count()


@pytest.fixture
def subscribe(peer: Clients, endpoint: str) -> Subscribe:
    def connect(*topics: bytes, **options: int) -> Peer:
        subscriber = peer(zmq.SUB, endpoint, **options)
        for topic in topics:
            subscriber.socket.setsockopt(zmq.SUBSCRIBE, topic)
        return subscriber

    return connect


async def hear(publisher: Publisher, subscriber: Peer, topic: str) -> None:
    """Publish until the subscriber receives, which shows that it is connected; then drop the messages."""
    await eventually(lambda: publisher.publish(topic, b"are you there?") or subscriber.got)
    last = b"settled %d" % next(NUMBERS)
    publisher.publish(topic, last)
    await eventually(lambda: subscriber.got[-1][1] == last)
    subscriber.got.clear()


async def test_a_latecomer_alone_gets_the_last_message_of_each_of_its_topics_and_fingers_exactly_once(
    endpoint: str, subscribe: Subscribe
) -> None:
    with Publisher(endpoint) as publisher:
        early = subscribe(b"")
        await hear(publisher, early, "status")
        for number, (topic, finger) in enumerate(
            (
                *(("slip.left", ""), ("grasp", ""), ("slip.right", ""), ("slip.thumb", ""), ("slip.left", "")),
                *(("warning", "left"), ("warning", "right"), ("warning", "left")),
            )
        ):
            publisher.publish(topic, b"%d" % number, finger)
        await eventually(lambda: len(early.got) == 8)
        late = [subscribe(b"slip", b"warning", b"slip.left") for _ in range(5)]  # the last of them is within the first
        await eventually(lambda: all(len(each.got) == 5 for each in late))
        publisher.publish("warning", b"new")
        await eventually(lambda: all(each.got[-1][1] == b"new" for each in [early, *late]))
    assert len(early.got) == 9, "what the latecomers got came to nobody else"
    told = [(b"slip.right", 2), (b"slip.thumb", 3), (b"slip.left", 4), (b"warning", 6), (b"warning", 7)]
    for each in late:
        assert each.got == [*([topic, b"%d" % n] for topic, n in told), [b"warning", b"new"]]


async def test_who_unsubscribes_gets_no_more(endpoint: str, peer: Clients) -> None:
    with Publisher(endpoint) as publisher:
        raw = peer(zmq.XSUB, endpoint)  # unlike SUB, it does not filter by itself
        raw.socket.send(b"\x01slip")
        raw.socket.send(b"\x01end")
        await hear(publisher, raw, "slip.left")
        raw.socket.send(b"\x00slip")
        raw.socket.send(b"\x01heard")
        publisher.publish("heard", b"")
        await eventually(lambda: [b"heard", b""] in raw.got)
        raw.got.clear()
        publisher.publish("slip.left", b"unwanted")
        publisher.publish("end", b"")
        await eventually(lambda: raw.got)
    assert raw.got == [[b"end", b""]]


async def test_Z1_a_subscriber_that_never_reads_costs_the_others_nothing(endpoint: str, subscribe: Subscribe) -> None:
    with Publisher(endpoint) as publisher:
        stalled, reader = subscribe(b"", RCVHWM=1), subscribe(b"")
        await eventually(lambda: publisher.publish("slip.left", b"") or (stalled.socket.poll(0) and reader.got))
        reader.got.clear()
        for number in range(10_000):
            publisher.publish("tactile.left", number.to_bytes(4, "big") * 500)
            if number % 100 == 99:
                await eventually(lambda: len(reader.got) > number)  # noqa: B023
        await eventually(lambda: stalled.got[-1] == reader.got[-1])  # what it missed are the oldest
    got = [int.from_bytes(payload[:4], "big") for topic, payload in reader.got if topic == b"tactile.left"]
    assert got == list(range(10_000))
    assert 0 < len(stalled.got) < 10_000


async def test_the_last_messages_before_the_stop_arrive(
    endpoint: str, subscribe: Subscribe, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listener, "LINGER_S", PATIENCE_S)  # a busy machine may need more than a tenth of a second
    with Publisher(endpoint) as publisher:
        subscriber = subscribe(b"")
        await hear(publisher, subscriber, "status")
        for _ in range(900):
            publisher.publish("status", bytes(4000))
    await eventually(lambda: len(subscriber.got) == 900)


@pytest.mark.parametrize(
    "flood",
    [
        [b"\x01%d" % number for number in range(publisher_module.MOST_SUBSCRIPTIONS + 1)],
        [b"\x01same"] * 5000,
        [b"\x01come", b"\x00come"] * 2500,
        [b"\x07hello"] * 5000,
    ],
    ids=["one too many", "same", "back and forth", "none"],
)
async def test_a_client_that_floods_subscriptions_is_disconnected_and_no_other(
    flood: list[bytes], endpoint: str, subscribe: Subscribe, peer: Clients, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(publisher_module, "time", StandingClock)
    with Publisher(endpoint) as publisher:
        early = subscribe(b"slip", RECONNECT_IVL=-1)
        await hear(publisher, early, "slip.left")
        rude = peer(zmq.XSUB, endpoint, RECONNECT_IVL=-1, SNDHWM=0)
        await eventually(lambda: len(publisher.peers) == 2)
        for message in flood:
            rude.socket.send(message)
        await eventually(lambda: len(publisher.peers) == 1)
        assert sum(map(len, publisher._wanted.values())) == 1
        await hear(publisher, early, "slip.left")
    assert publisher.accepted == 2, "nobody else was disconnected"


async def test_the_longest_subscription_is_served_and_a_longer_one_ends_the_connection(
    endpoint: str, subscribe: Subscribe
) -> None:
    """libzmq sends it as a command of ZMTP 3.1, which is longer than the message of ZMTP 3.0."""
    longest = "x" * publisher_module.MAX_PREFIX_BYTES
    with Publisher(endpoint) as publisher:
        await hear(publisher, subscribe(longest.encode()), longest)
        subscribe(f"{longest}y".encode(), RECONNECT_IVL=-1)
        await eventually(lambda: publisher.refused == 1)
    assert publisher.accepted == 2


async def test_Z2_a_storm_of_reconnections_leaks_nothing(endpoint: str, subscribe: Subscribe) -> None:
    with Publisher(endpoint) as publisher:
        publisher.publish("slip.left", b"last")
        staying = subscribe(b"slip.left")
        await eventually(lambda: staying.got)
        before = open_files()
        for cycle in range(300):
            subscriber = subscribe(b"slip.left")
            if cycle % 10 == 0:
                await eventually(lambda: subscriber.got == [[b"slip.left", b"last"]])  # noqa: B023
            subscriber.socket.close()
        await eventually(lambda: open_files() <= before)
