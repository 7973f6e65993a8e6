"""Subscribers of a publisher, and a wait until one is served."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest
import zmq

from slipd.io.bus.publisher import Publisher

if TYPE_CHECKING:
    from loop_waits import Eventually
    from zeromq_peers import Peer


Subscribe = Callable[..., "Peer"]


@pytest.fixture
def subscribe(peer: Callable[..., Peer], endpoint: str) -> Subscribe:
    def connect(*topics: bytes, **options: int) -> Peer:
        subscriber = peer(zmq.SUB, endpoint, **options)
        for topic in topics:
            subscriber.socket.setsockopt(zmq.SUBSCRIBE, topic)
        return subscriber

    return connect


async def hear(publisher: Publisher, subscriber: Peer, topic: str, eventually: Eventually) -> None:
    """Publish until the subscriber receives, which shows that it is connected; then drop the messages."""

    def heard() -> bool:
        publisher.publish(topic, b"are you there?")
        return bool(subscriber.got)

    await eventually(heard)
    last = f"settled {publisher.published}".encode()
    publisher.publish(topic, last)
    await eventually(lambda: subscriber.got[-1][1] == last)
    subscriber.got.clear()
