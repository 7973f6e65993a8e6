"""Requests are delivered, replies return to their client; what is no request, or one too many, is refused."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import pytest
import zmq
from loop_waits import eventually
from zeromq_peers import Clients, Peer, StandingClock

from slipd.io import request_server
from slipd.io.request_server import MOST_QUEUED, RequestServer
from slipd.io.zmtp.endpoint import USER_ALONE, Access
from slipd_client.messages import CHECK_LIMITS, PROTOCOL_VERSION, decode, encode

pytestmark = pytest.mark.usefixtures("loop_faults")

LOCAL = Access(local_tcp=True)
HELLO = {"v": 1, "id": "1", "op": "hello"}

SELDOM = 1e-6
"""Requests a second: one, and then none as long as a test lasts."""


class Answering(RequestServer):
    """Answer every request."""

    def __init__(self, endpoint: str, access: Access = USER_ALONE, per_second: float = 1e6) -> None:
        self.requests: list[tuple[bytes, dict[str, Any]]] = []
        super().__init__(endpoint, self._answer, access, per_second=per_second)

    def _answer(self, client: bytes, body: dict[str, Any]) -> None:
        self.requests.append((client, body))
        self.reply(client, {"v": PROTOCOL_VERSION, "id": body.get("id"), "ok": True, "result": {}})


Dealer = Callable[..., Peer]


@pytest.fixture
def dealer(peer: Clients, endpoint: str) -> Dealer:
    return lambda **options: peer(zmq.DEALER, endpoint, **options)


def replies(client: Peer) -> list[dict[str, Any]]:
    return [decode(b"".join(frames)) for frames in client.got]


async def expect_service(client: Peer) -> None:
    client.got.clear()
    client.socket.send(encode(HELLO | {"id": "still there?"}))
    await eventually(lambda: any(reply["id"] == "still there?" for reply in replies(client)))


async def test_a_request_is_delivered_and_its_reply_comes_back(endpoint: str, dealer: Dealer) -> None:
    with Answering(endpoint) as server:
        server.reply(b"\0nobody", {"ok": True})
        clients = [dealer() for _ in range(3)]
        for number, client in enumerate(clients):
            client.socket.send(encode(HELLO | {"id": str(number)}))
        await eventually(lambda: all(client.got for client in clients))
    assert [[reply["id"] for reply in replies(client)] for client in clients] == [["0"], ["1"], ["2"]]
    assert sorted(body["id"] for _, body in server.requests) == ["0", "1", "2"]


@pytest.mark.parametrize(
    ("frames", "code"),
    [
        ([b""], "malformed"),
        ([b"\x90"], "malformed"),
        ([b"\x82\xa1a\x01\xa1a\x02"], "malformed"),
        ([b"\x91" * 16_000], "malformed"),
        ([b"\xc1"], "malformed"),
        ([b"\x82\xa2id\x07\xa1a\xcb\x7f\xf8\x00\x00\x00\x00\x00\x00"], "not_finite"),
        ([b"", encode(HELLO)], "malformed"),
        ([encode(HELLO)] * 2, "malformed"),
        ([b"x" * 100] * 10_000, "malformed"),
    ],
)
async def test_what_is_no_request_is_refused_once_with_the_reason(
    frames: list[bytes], code: str, endpoint: str, dealer: Dealer
) -> None:
    with Answering(endpoint) as server:
        client = dealer()
        client.socket.send_multipart(frames)
        await eventually(lambda: client.got)
        (reply,) = replies(client)
        number = 7 if code == "not_finite" else None
        assert (reply["v"], reply["id"], reply["ok"], reply["error"]["code"]) == (PROTOCOL_VERSION, number, False, code)
        assert not reply["error"]["message"].endswith(": ")
        await expect_service(client)
    assert [body["id"] for _, body in server.requests] == ["still there?"]


async def test_a_REQ_socket_gets_replies_and_refusals(endpoint: str, peer: Clients) -> None:
    heard = []
    with Answering(endpoint):
        client = peer(zmq.REQ, endpoint)
        for frames in ([encode(HELLO)], [b"x"], [b"x", b"y"], [b"", encode(HELLO)], [encode(HELLO)]):
            client.socket.send_multipart(frames)
            await eventually(lambda: client.socket.poll(0))
            heard.append(decode(client.socket.recv())["ok"])
    assert heard == [True, False, False, False, True]


async def test_a_request_of_the_largest_size_is_read_and_one_byte_more_ends_the_connection(
    endpoint: str, dealer: Dealer
) -> None:
    with Answering(endpoint):
        other, largest, beyond = dealer(), dealer(), dealer(RECONNECT_IVL=-1)
        largest.socket.send(bytes(CHECK_LIMITS.data_bytes))
        await eventually(lambda: largest.got)
        assert [reply["error"]["code"] for reply in replies(largest)] == ["malformed"]
        await expect_service(beyond)
        beyond.got.clear()
        beyond.socket.send(bytes(CHECK_LIMITS.data_bytes + 1))
        await eventually(lambda: not beyond.can_send())  # it has no connection left
        await expect_service(other)
    assert beyond.got == []


async def test_Z5_a_second_client_under_the_name_of_another_gets_nothing_of_it(endpoint: str, dealer: Dealer) -> None:
    with Answering(endpoint) as server:
        first = dealer(ROUTING_ID=b"name")
        await expect_service(first)
        second = dealer(ROUTING_ID=b"name")
        second.socket.send(encode(HELLO))
        for _ in range(10):
            await expect_service(first)
        assert second.got == []
    process, _, route = server.requests[0][0].partition(b"\0")
    assert process.endswith(b":%d:%d:%d" % (os.geteuid(), os.getegid(), os.getpid()))
    assert route == b"name"


async def test_a_fault_of_the_consumer_reaches_the_loop_and_the_next_request_is_served(
    endpoint: str, dealer: Dealer, loop_faults: list[dict[str, Any]]
) -> None:
    def fail(_: bytes, body: dict[str, Any]) -> None:
        raise ArithmeticError(body["id"])

    with RequestServer(endpoint, fail):
        client = dealer()
        for number in "12":
            client.socket.send(encode(HELLO | {"id": number}))
        await eventually(lambda: len(loop_faults) == 2)
    assert [str(fault["exception"]) for fault in loop_faults] == ["1", "2"]
    loop_faults.clear()


async def test_a_client_that_never_reads_its_replies_delays_nobody(endpoint: str, dealer: Dealer) -> None:
    with Answering(endpoint) as server:
        silent = dealer(RCVHWM=1, SNDHWM=0, SNDBUF=4096, RCVBUF=4096)
        request = encode(HELLO | {"id": "x" * 1000})
        await eventually(
            lambda: (
                [silent.socket.send(request) for _ in range(200)]
                and any(peer.protocol.waiting > MOST_QUEUED for peer in server.peers)
            )  # further replies are dropped
        )
        await expect_service(dealer())


@pytest.mark.parametrize("kind", ["ipc", "tcp"])
async def test_a_client_with_too_many_requests_is_refused_then_disconnected_and_others_are_served(
    kind: str, endpoint: str, peer: Clients, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Over TCP without keys, all clients of a machine are distinguished by their connections alone."""
    monkeypatch.setattr(request_server, "time", StandingClock)
    with Answering(endpoint if kind == "ipc" else "tcp://127.0.0.1:*", LOCAL, per_second=5.0) as server:
        hasty = peer(zmq.DEALER, server.endpoint, RECONNECT_IVL=-1, IMMEDIATE=1)
        patient = peer(zmq.DEALER, server.endpoint)
        await eventually(hasty.can_send)
        for number in range(8):
            hasty.socket.send(encode(HELLO | {"id": number}))
        await eventually(lambda: len(hasty.got) == 8)
        told = [(reply["id"], reply["ok"] or reply["error"]["code"]) for reply in replies(hasty)]
        assert told == list(enumerate([True] * 5 + ["busy"] * 3))
        for _ in range(100):
            hasty.socket.send(encode(HELLO))
        await eventually(lambda: not hasty.can_send())
        await expect_service(patient)


async def test_to_connect_again_brings_no_new_allowance(endpoint: str, dealer: Dealer) -> None:
    answers = []
    with Answering(endpoint, per_second=SELDOM) as server:
        for number in range(20):
            hasty = dealer(RECONNECT_IVL=-1)
            hasty.socket.send(encode(HELLO | {"id": number}))
            await eventually(lambda: hasty.got or not hasty.can_send())  # noqa: B023
            answers.append([reply["ok"] or reply["error"]["code"] for reply in replies(hasty)])
            hasty.socket.close()
            await eventually(lambda: not server._names)
    assert [body["id"] for _, body in server.requests] == [0]
    assert answers == [[True], ["busy"], *[[]] * 18]


@pytest.mark.parametrize(
    ("op", "passes"), [("lease.renew", True), ("gripper.stop", True), ("grip.hold", True), ("grip.set", False)]
)
async def test_urgent_requests_pass_when_the_allowance_is_used_up(
    op: str, passes: bool, endpoint: str, dealer: Dealer
) -> None:
    with Answering(endpoint, per_second=SELDOM):
        client = dealer()
        client.socket.send(encode(HELLO))
        client.socket.send(encode({"v": 1, "id": op, "op": op}))
        await eventually(lambda: len(client.got) == 2)
    assert [reply["ok"] for reply in replies(client)] == [True, passes]
