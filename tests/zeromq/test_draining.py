from __future__ import annotations

import asyncio
import select
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest
import zmq

from slipd.zeromq.draining import FRAMES_PER_WAKE, Drain

if TYPE_CHECKING:
    from zeromq_peers import Context, Eventually, Peer

pytestmark = pytest.mark.usefixtures("loop_faults")


@pytest.fixture
def server(context: Context, endpoint: str) -> Iterator[zmq.Socket[bytes]]:
    server = context.socket(zmq.ROUTER)
    server.setsockopt(zmq.RCVHWM, 0)
    server.setsockopt(zmq.LINGER, 0)
    server.bind(endpoint)
    yield server
    server.close()


@pytest.fixture
def client(peer: Callable[..., Peer], endpoint: str) -> Peer:
    return peer(zmq.DEALER, endpoint, ROUTING_ID=b"c", SNDHWM=0)


def wait_unseen(server: zmq.Socket[bytes]) -> None:
    """Wait for the wake-up of a message without the loop seeing it."""
    select.select([server.getsockopt(zmq.FD)], [], [], 30)


async def test_messages_that_wait_already_are_read(
    server: zmq.Socket[bytes], client: Peer, eventually: Eventually
) -> None:
    for number in range(5):
        client.socket.send(b"%d" % number)
    assert server.poll(30_000)  # uses the wake-up
    got: list[list[bytes]] = []
    drain = Drain(server, got.append, max_frames=2)
    drain.start()
    await eventually(lambda: len(got) == 5)
    assert got == [[b"c", b"%d" % number] for number in range(5)]
    drain.stop()


async def test_a_wake_up_that_a_send_used_is_made_good(
    server: zmq.Socket[bytes], client: Peer, eventually: Eventually
) -> None:
    got: list[list[bytes]] = []
    drain = Drain(server, got.append, max_frames=2)
    drain.start()
    client.socket.send(b"0")
    await eventually(lambda: got)
    for number in range(1, 20):
        client.socket.send(b"%d" % number)
        wait_unseen(server)
        server.getsockopt(zmq.EVENTS)  # what a send does inside, sooner or later
        server.send_multipart([b"c", b"pong"])
        drain.after_send()
        await eventually(lambda: len(got) == number + 1)  # noqa: B023
    drain.stop()


async def test_a_flood_leaves_the_loop_its_turns(
    server: zmq.Socket[bytes], client: Peer, eventually: Eventually
) -> None:
    turn = 0
    turns: list[int] = []

    def tick() -> None:
        nonlocal turn
        turn += 1
        if len(turns) < 2000:
            asyncio.get_running_loop().call_soon(tick)

    for _ in range(2000):
        client.socket.send(b"flood")
    drain = Drain(server, lambda _: turns.append(turn), max_frames=2)
    drain.start()
    tick()
    await eventually(lambda: len(turns) == 2000)
    assert max(turns.count(each) for each in set(turns)) <= FRAMES_PER_WAKE  # two frames each, at most twice a turn
    drain.stop()


@pytest.mark.parametrize("parts", [1, 2, 3, 500])
async def test_a_message_with_too_many_frames_is_handed_on_cut_but_recognisable(
    parts: int, server: zmq.Socket[bytes], client: Peer, eventually: Eventually
) -> None:
    got: list[list[bytes]] = []
    drain = Drain(server, got.append, max_frames=2)
    drain.start()
    client.socket.send_multipart([b"%d" % part for part in range(parts)])
    client.socket.send(b"next")
    await eventually(lambda: len(got) == 2)
    assert got[0] == [b"c", *(b"%d" % part for part in range(min(parts, 2)))]
    assert got[1] == [b"c", b"next"]
    drain.stop()


async def test_a_fault_of_the_consumer_reaches_the_loop_and_reading_goes_on(
    server: zmq.Socket[bytes], client: Peer, eventually: Eventually, loop_faults: list[dict[str, Any]]
) -> None:
    got: list[bytes] = []

    def fail(frames: list[bytes]) -> None:
        got.append(frames[1])
        raise ArithmeticError(frames[1])

    for number in range(3):
        client.socket.send(b"%d" % number)
    assert server.poll(30_000)
    drain = Drain(server, fail, max_frames=2)
    drain.start()
    await eventually(lambda: len(got) == 3)
    assert [str(fault["exception"]) for fault in loop_faults] == ["b'0'", "b'1'", "b'2'"]
    loop_faults.clear()
    drain.stop()


async def test_nothing_is_read_after_the_stop(server: zmq.Socket[bytes], client: Peer) -> None:
    got: list[list[bytes]] = []
    drain = Drain(server, got.append, max_frames=2)
    client.socket.send(b"waiting")
    assert server.poll(30_000)
    drain.start()
    drain.stop()
    assert not asyncio.get_running_loop().remove_reader(server.getsockopt(zmq.FD))
    client.socket.send(b"later")
    for _ in range(10):
        await asyncio.sleep(0)
    assert got == []
