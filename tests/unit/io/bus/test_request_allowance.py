"""How many requests a client may send, so that none keeps the others from being served."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest
import zmq
from answering_server import HELLO, Answering, expect_service, replies

from slipd_client.messages import encode

if TYPE_CHECKING:
    from loop_waits import Eventually
    from zeromq_peers import Context, Peer

pytestmark = pytest.mark.usefixtures("loop_faults")


async def test_a_client_that_never_reads_its_replies_delays_nobody(
    answering: Answering, dealer: Callable[..., Peer], eventually: Eventually
) -> None:
    with answering.server as server:
        silent = dealer(RCVHWM=1, SNDHWM=0, SNDBUF=4096, RCVBUF=4096)
        request = encode(HELLO | {"id": "x" * 1000})

        def flood() -> bool:
            for _ in range(200):
                silent.socket.send(request)
            return server.undelivered > 0

        await eventually(flood)
        await expect_service(dealer(), eventually)


async def test_a_flood_does_not_keep_another_client_from_being_served(
    answering: Answering, dealer: Callable[..., Peer], clients: Context, endpoint: str, eventually: Eventually
) -> None:
    stop = threading.Event()

    def flood() -> None:
        with clients.socket(zmq.DEALER) as flooder:
            flooder.setsockopt(zmq.LINGER, 0)
            flooder.connect(endpoint)
            while not stop.is_set():
                if flooder.poll(10, zmq.POLLOUT):
                    flooder.send(b"\xc1")

    thread = threading.Thread(target=flood)
    with answering.server as server:
        thread.start()
        try:
            await eventually(lambda: server.malformed > 1000)
            polite = dealer()
            for _ in range(20):
                await expect_service(polite, eventually)
        finally:
            stop.set()
            thread.join()


async def test_a_client_that_sends_too_many_requests_is_refused_and_others_are_served(
    endpoint: str, dealer: Callable[..., Peer], eventually: Eventually
) -> None:
    answering = Answering(endpoint, per_second=5.0)
    with answering.server as server:
        hasty, patient = dealer(), dealer()
        for number in range(8):
            hasty.socket.send(encode(HELLO | {"id": number}))
        await eventually(lambda: len(hasty.got) == 8)
        assert [reply["id"] for reply in replies(hasty)] == list(range(8))
        assert [reply["ok"] for reply in replies(hasty)] == [True] * 5 + [False] * 3
        assert {reply["error"]["code"] for reply in replies(hasty)[5:]} == {"busy"}
        await expect_service(patient, eventually)
        assert (server.busy, server.unanswered) == (3, 0)


async def test_who_does_not_heed_it_is_disconnected_and_others_are_not(
    endpoint: str, dealer: Callable[..., Peer], eventually: Eventually
) -> None:
    answering = Answering(endpoint, per_second=5.0)
    with answering.server as server:
        hasty, patient = dealer(RECONNECT_IVL=-1, IMMEDIATE=1), dealer()
        await expect_service(patient, eventually)
        for _ in range(100):
            hasty.socket.send(encode(HELLO))
        await eventually(lambda: not hasty.socket.poll(0, zmq.POLLOUT))
        await eventually(lambda: server.unanswered)
        await expect_service(patient, eventually)
        assert len(answering.requests) <= 5 + 2


SELDOM = 1e-6
"""Requests a second: one, and then none as long as a test lasts."""


async def test_to_connect_again_brings_no_new_allowance(
    endpoint: str, peer: Callable[..., Peer], eventually: Eventually
) -> None:
    answering = Answering(endpoint, per_second=SELDOM)
    with answering.server as server:
        for number in range(20):
            hasty = peer(zmq.DEALER, endpoint, RECONNECT_IVL=-1)
            hasty.socket.send(encode(HELLO | {"id": number}))
            await eventually(lambda: len(answering.requests) + server.busy == number + 1)  # noqa: B023
            hasty.socket.close()
            await eventually(lambda: not server._names)
        assert [body["id"] for body in answering.requests] == [0]
        assert (server.busy, server.unanswered) == (19, 18)


@pytest.mark.parametrize(
    ("op", "passes"), [("lease.renew", True), ("gripper.stop", True), ("grip.hold", True), ("grip.set", False)]
)
async def test_urgent_requests_pass_when_the_allowance_is_used_up(
    op: str, passes: bool, endpoint: str, dealer: Callable[..., Peer], eventually: Eventually
) -> None:
    answering = Answering(endpoint, per_second=SELDOM)
    with answering.server:
        client = dealer()
        client.socket.send(encode(HELLO))
        client.socket.send(encode({"v": 1, "id": op, "op": op}))
        await eventually(lambda: len(client.got) == 2)
    assert [reply["ok"] for reply in replies(client)] == [True, passes]
