"""Requests are delivered, replies return to their client; what is no request, or one too many, is refused."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest
import zmq
from answering_server import HELLO, Answering, expect_service, replies
from hypothesis import given
from hypothesis import strategies as st
from zeromq_peers import StandingClock

from slipd.io.bus import request_server
from slipd.io.bus.request_server import RequestServer
from slipd.io.zmtp.endpoint import Access
from slipd_client.messages import CHECK_LIMITS, PROTOCOL_VERSION, MessageError, decode, encode

if TYPE_CHECKING:
    from loop_waits import Eventually
    from zeromq_peers import Context, Peer

    Dealer = Callable[..., Peer]

pytestmark = pytest.mark.usefixtures("loop_faults")

LOCAL = Access(local_tcp=True)

SELDOM = 1e-6
"""Requests a second: one, and then none as long as a test lasts."""


async def test_a_request_is_delivered_and_its_reply_comes_back(
    answering: Answering, dealer: Dealer, eventually: Eventually
) -> None:
    with answering.server as server:
        server.reply(b"\0nobody", {"ok": True})
        assert server.undelivered == 1
        clients = [dealer() for _ in range(3)]
        for number, client in enumerate(clients):
            client.socket.send(encode(HELLO | {"id": str(number)}))
        await eventually(lambda: all(client.got for client in clients))
        assert [[reply["id"] for reply in replies(client)] for client in clients] == [["0"], ["1"], ["2"]]
    assert sorted(body["id"] for body in answering.requests) == ["0", "1", "2"]


@pytest.mark.parametrize(
    ("frames", "code"),
    [
        ([b""], "malformed"),
        ([b"\x90"], "malformed"),
        ([b"\x82\xa1a\x01\xa1a\x02"], "malformed"),
        ([b"\x91" * 16_000], "malformed"),
        ([b"\x81\xa1a\xcb\x7f\xf8\x00\x00\x00\x00\x00\x00"], "not_finite"),
        ([b"", encode(HELLO)], "malformed"),
        ([encode(HELLO)] * 2, "malformed"),
        ([b"x" * 100] * 10_000, "malformed"),
    ],
)
async def test_what_is_no_request_is_refused_once_with_the_reason(
    frames: list[bytes], code: str, answering: Answering, dealer: Dealer, eventually: Eventually
) -> None:
    with answering.server:
        client = dealer()
        client.socket.send_multipart(frames)
        await eventually(lambda: client.got)
        (reply,) = replies(client)
        assert (reply["v"], reply["id"], reply["ok"]) == (PROTOCOL_VERSION, None, False)
        assert (reply["error"]["code"], type(reply["error"]["field"])) == (code, str)
        assert reply["error"]["message"]
        await expect_service(client, eventually)
    assert (answering.server.malformed, len(answering.requests)) == (1, 1)


class _Judged(RequestServer):
    """Judges messages without a socket."""

    def __init__(self) -> None:
        self.requests: list[dict[str, Any]] = []
        self.replies: list[dict[str, Any]] = []
        super().__init__("", lambda _, body: self.requests.append(body), per_second=1e6)

    def reply(self, client: bytes, body: dict[str, Any]) -> None:
        self.replies.append(body)


class _Stranger:
    """What the server reads of a peer."""

    kind, key, route, address, slot = b"DEALER", b"", b"", b":0:0:1", 0

    class account:  # noqa: N801 - an attribute of a peer
        name = b":0:0:1"


VALID = encode(HELLO | {"deadline_ns": 1 << 40, "force_n": 12.5})


@given(st.binary(max_size=200), st.lists(st.tuples(st.integers(0, len(VALID) - 1), st.integers(0, 255)), max_size=3))
def test_any_bytes_are_a_request_or_are_refused_and_raise_nothing(data: bytes, damage: list[tuple[int, int]]) -> None:
    damaged = bytearray(VALID)
    for at, value in damage:
        damaged[at] = value
    server, peer = _Judged(), _Stranger()
    server.on_ready(peer)  # type: ignore[arg-type]
    for message in (data, bytes(damaged)):
        server.on_message(peer, [message])  # type: ignore[arg-type]
        try:
            assert server.requests.pop() == decode(message)
        except IndexError:
            assert not server.replies.pop()["ok"]
            with pytest.raises(MessageError):
                decode(message)


async def test_a_REQ_socket_gets_replies_and_refusals(
    answering: Answering, peer: Callable[..., Peer], endpoint: str, eventually: Eventually
) -> None:
    with answering.server:
        client = peer(zmq.REQ, endpoint)
        heard = []
        for frames in ([encode(HELLO)], [b"x"], [b"x", b"y"], [b"", encode(HELLO)], [encode(HELLO)]):
            client.socket.send_multipart(frames)
            await eventually(lambda: client.socket.poll(0))
            heard.append(decode(client.socket.recv()))
    assert [reply["ok"] for reply in heard] == [True, False, False, False, True]
    assert answering.server.malformed == 3


async def test_a_request_of_the_largest_size_is_read_and_one_byte_more_ends_the_connection(
    answering: Answering, dealer: Dealer, eventually: Eventually
) -> None:
    with answering.server:
        other, largest, beyond = dealer(), dealer(), dealer(RECONNECT_IVL=-1)
        largest.socket.send(bytes(CHECK_LIMITS.data_bytes))
        await eventually(lambda: largest.got)
        await expect_service(beyond, eventually)
        beyond.got.clear()
        beyond.socket.send(bytes(CHECK_LIMITS.data_bytes + 1))
        await eventually(lambda: not beyond.socket.poll(0, zmq.POLLOUT))  # it has no connection left
        await expect_service(other, eventually)
        assert beyond.got == []
    assert answering.server.malformed == 1


async def test_Z5_a_second_client_under_the_name_of_another_gets_nothing_of_it(
    answering: Answering, dealer: Dealer, eventually: Eventually
) -> None:
    with answering.server:
        first = dealer(ROUTING_ID=b"name")
        await expect_service(first, eventually)
        second = dealer(ROUTING_ID=b"name")
        second.socket.send(encode(HELLO))
        for _ in range(10):
            await expect_service(first, eventually)
        assert second.got == []
    process, _, route = answering.clients[0].partition(b"\0")
    assert process.endswith(b":%d:%d:%d" % (os.geteuid(), os.getegid(), os.getpid()))
    assert route == b"name"


async def test_connections_that_do_not_speak_zeromq_keep_nobody_out(
    peer: Callable[..., Peer], eventually: Eventually
) -> None:
    answering = Answering("tcp://127.0.0.1:*", LOCAL)
    with answering.server as server:
        port = int(server.endpoint.rpartition(":")[2])
        raw = [socket.create_connection(("127.0.0.1", port)) for _ in range(50)]
        for number, connection in enumerate(raw):
            connection.sendall([b"", b"GET / HTTP/1.1\r\n\r\n", b"\xff" + bytes(8) + b"\x7f\x03"][number % 3])
        await expect_service(peer(zmq.DEALER, server.endpoint), eventually)
        for connection in raw:
            connection.close()


async def test_a_fault_of_the_consumer_reaches_the_loop_and_the_next_request_is_served(
    endpoint: str, dealer: Dealer, eventually: Eventually, loop_faults: list[dict[str, Any]]
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


async def test_a_client_that_never_reads_its_replies_delays_nobody(
    answering: Answering, dealer: Dealer, eventually: Eventually
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
    answering: Answering, dealer: Dealer, clients: Context, endpoint: str, eventually: Eventually
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


@pytest.mark.parametrize("kind", ["ipc", "tcp"])
async def test_a_client_with_too_many_requests_is_refused_then_disconnected_and_others_are_served(
    kind: str, endpoint: str, peer: Callable[..., Peer], eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Over TCP without keys, all clients of a machine are distinguished by their connections alone."""
    monkeypatch.setattr(request_server, "time", StandingClock)
    answering = Answering(endpoint, per_second=5.0) if kind == "ipc" else Answering("tcp://127.0.0.1:*", LOCAL, 5.0)
    with answering.server as server:
        hasty = peer(zmq.DEALER, server.endpoint, RECONNECT_IVL=-1, IMMEDIATE=1)
        patient = peer(zmq.DEALER, server.endpoint)
        await eventually(lambda: hasty.socket.poll(0, zmq.POLLOUT))
        for number in range(8):
            hasty.socket.send(encode(HELLO | {"id": number}))
        await eventually(lambda: len(hasty.got) == 8)
        assert [reply["id"] for reply in replies(hasty)] == list(range(8))
        assert [reply["ok"] for reply in replies(hasty)] == [True] * 5 + [False] * 3
        assert {reply["error"]["code"] for reply in replies(hasty)[5:]} == {"busy"}
        assert (server.busy, server.unanswered) == (3, 0)
        for _ in range(100):
            hasty.socket.send(encode(HELLO))
        await eventually(lambda: server.unanswered and not hasty.socket.poll(0, zmq.POLLOUT))
        await expect_service(patient, eventually)


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
    op: str, passes: bool, endpoint: str, dealer: Dealer, eventually: Eventually
) -> None:
    with Answering(endpoint, per_second=SELDOM).server:
        client = dealer()
        client.socket.send(encode(HELLO))
        client.socket.send(encode({"v": 1, "id": op, "op": op}))
        await eventually(lambda: len(client.got) == 2)
    assert [reply["ok"] for reply in replies(client)] == [True, passes]
