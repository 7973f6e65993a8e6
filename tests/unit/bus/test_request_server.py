from __future__ import annotations

import os
import random
import socket
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest
import zmq

from slipd.bus.request_server import RequestServer
from slipd.zmtp.endpoint import USER_ALONE, Access
from slipd_client.messages import PROTOCOL_VERSION, REQUEST_LIMITS, MessageError, decode, encode

if TYPE_CHECKING:
    from loop_waits import Eventually
    from zeromq_peers import Context, Peer

pytestmark = pytest.mark.usefixtures("loop_faults")

HELLO = {"v": 1, "id": "1", "op": "hello"}


class Answering:
    """Answer every request with its own body."""

    def __init__(self, endpoint: str, access: Access = USER_ALONE, per_second: float = 1e6) -> None:
        self.requests: list[dict[str, Any]] = []
        self.clients: list[bytes] = []
        self.server = RequestServer(endpoint, self._on_request, access, per_second=per_second)

    def _on_request(self, client: bytes, body: dict[str, Any]) -> None:
        self.requests.append(body)
        self.clients.append(client)
        self.server.reply(client, {"v": PROTOCOL_VERSION, "id": body.get("id"), "ok": True, "result": {}})


@pytest.fixture
def answering(endpoint: str) -> Answering:
    return Answering(endpoint)


@pytest.fixture
def dealer(peer: Callable[..., Peer], endpoint: str) -> Callable[..., Peer]:
    return lambda **options: peer(zmq.DEALER, endpoint, **options)


def replies(client: Peer) -> list[dict[str, Any]]:
    return [decode(b"".join(frames)) for frames in client.got]


async def expect_service(client: Peer, eventually: Eventually) -> None:
    client.got.clear()
    client.socket.send(encode(HELLO | {"id": "still there?"}))
    await eventually(lambda: any(reply["id"] == "still there?" for reply in replies(client)))


async def test_a_request_is_delivered_and_its_reply_comes_back(
    answering: Answering, dealer: Callable[..., Peer], eventually: Eventually
) -> None:
    with answering.server:
        clients = [dealer() for _ in range(3)]
        for number, client in enumerate(clients):
            client.socket.send(encode(HELLO | {"id": str(number)}))
        await eventually(lambda: all(client.got for client in clients))
        assert [[reply["id"] for reply in replies(client)] for client in clients] == [["0"], ["1"], ["2"]]
    assert sorted(body["id"] for body in answering.requests) == ["0", "1", "2"]


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"", "malformed"),
        (b"\xc1", "malformed"),
        (b"\x90", "malformed"),
        (b"\x80\x80", "malformed"),
        (b"\x82\xa1a\x01\xa1a\x02", "malformed"),
        (b"\x81\x01\x01", "malformed"),
        (b"\x81\xa1a\xd4\x01\x00", "malformed"),
        (b"\x91" * 16_000, "malformed"),
        (b"\xdd\xff\xff\xff\xff", "malformed"),
        (b"\x81\xa1a\xa2\xff\xfe", "malformed"),
        (b"\x81\xa1a\xcb\x7f\xf8\x00\x00\x00\x00\x00\x00", "not_finite"),
    ],
)
async def test_bytes_that_are_no_request_are_refused_with_the_reason(
    data: bytes, code: str, answering: Answering, dealer: Callable[..., Peer], eventually: Eventually
) -> None:
    with answering.server:
        client = dealer()
        client.socket.send(data)
        await eventually(lambda: client.got)
        (reply,) = replies(client)
        assert (reply["v"], reply["id"], reply["ok"]) == (PROTOCOL_VERSION, None, False)
        assert reply["error"]["code"] == code
        assert reply["error"]["message"]
        assert type(reply["error"]["field"]) is str
        await expect_service(client, eventually)
    assert answering.server.malformed == 1


async def test_random_bytes_raise_nothing_and_each_is_answered(
    answering: Answering, dealer: Callable[..., Peer], eventually: Eventually
) -> None:
    draw = random.Random(7)
    sent = [draw.randbytes(draw.randrange(200)) for _ in range(500)]
    valid = encode(HELLO | {"deadline_ns": 1 << 40, "force_n": 12.5})
    for _ in range(500):
        mutated = bytearray(valid)
        for _ in range(draw.randrange(1, 4)):
            mutated[draw.randrange(len(mutated))] = draw.randrange(256)
        sent.append(bytes(mutated))

    def refused(data: bytes) -> bool:
        try:
            decode(data)
        except MessageError:
            return True
        return False

    with answering.server:
        client = dealer(SNDHWM=0, RCVHWM=0)
        for number, data in enumerate(sent):
            client.socket.send(data)
            if number % 50 == 49:
                await eventually(lambda: len(client.got) == number + 1)  # noqa: B023
    assert answering.server.malformed == sum(map(refused, sent))
    assert len(answering.requests) == len(sent) - answering.server.malformed


@pytest.mark.parametrize("frames", [[b"", encode(HELLO)], [encode(HELLO)] * 2, [b"x" * 100] * 10_000, [b""] * 3])
async def test_a_request_of_several_frames_is_refused_once(
    frames: list[bytes], answering: Answering, dealer: Callable[..., Peer], eventually: Eventually
) -> None:
    with answering.server:
        client = dealer()
        client.socket.send_multipart(frames)
        await eventually(lambda: client.got)
        assert replies(client)[0]["error"]["code"] == "malformed"
        await expect_service(client, eventually)
    assert answering.server.malformed == 1
    assert len(answering.requests) == 1


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
    answering: Answering, dealer: Callable[..., Peer], eventually: Eventually
) -> None:
    with answering.server:
        other, largest, beyond = dealer(), dealer(), dealer(RECONNECT_IVL=-1)
        largest.socket.send(bytes(REQUEST_LIMITS.data_bytes))
        await eventually(lambda: largest.got)
        await expect_service(beyond, eventually)
        beyond.got.clear()
        beyond.socket.send(bytes(REQUEST_LIMITS.data_bytes + 1))
        await eventually(lambda: not beyond.socket.poll(0, zmq.POLLOUT))  # it has no connection left
        await expect_service(other, eventually)
        assert beyond.got == []
    assert answering.server.malformed == 1


async def test_a_reply_to_a_client_that_is_gone_is_counted(
    answering: Answering, dealer: Callable[..., Peer], eventually: Eventually
) -> None:
    with answering.server as server:
        server.reply(b"\0nobody", {"ok": True})
        assert server.undelivered == 1
        await expect_service(dealer(), eventually)


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


async def test_the_same_over_tcp(peer: Callable[..., Peer], eventually: Eventually) -> None:
    answering = Answering("tcp://127.0.0.1:*", Access(local_tcp=True), per_second=5.0)
    with answering.server as server:
        hasty = peer(zmq.DEALER, server.endpoint, RECONNECT_IVL=-1, IMMEDIATE=1)
        await eventually(lambda: hasty.socket.poll(0, zmq.POLLOUT))
        for _ in range(100):
            hasty.socket.send(encode(HELLO))
        await eventually(lambda: not hasty.socket.poll(0, zmq.POLLOUT))


async def test_Z5_a_client_is_known_by_its_process_and_not_by_the_name_it_chose_alone(
    answering: Answering, dealer: Callable[..., Peer], eventually: Eventually
) -> None:
    with answering.server:
        await expect_service(dealer(ROUTING_ID=b"name"), eventually)
    process, _, route = answering.clients[0].partition(b"\0")
    assert process.endswith(b":%d:%d:%d" % (os.geteuid(), os.getegid(), os.getpid()))
    assert route == b"name"


async def test_Z5_a_second_client_under_the_name_of_another_gets_nothing_of_it(
    answering: Answering, dealer: Callable[..., Peer], eventually: Eventually
) -> None:
    with answering.server:
        first = dealer(ROUTING_ID=b"name")
        await expect_service(first, eventually)
        second = dealer(ROUTING_ID=b"name")
        second.socket.send(encode(HELLO))
        for _ in range(10):
            await expect_service(first, eventually)
        assert second.got == []


async def test_connections_that_do_not_speak_zeromq_keep_nobody_out(
    peer: Callable[..., Peer], eventually: Eventually
) -> None:
    answering = Answering("tcp://127.0.0.1:*", Access(local_tcp=True))
    with answering.server as server:
        port = int(server.endpoint.rpartition(":")[2])
        raw = [socket.create_connection(("127.0.0.1", port)) for _ in range(50)]
        for number, connection in enumerate(raw):
            connection.sendall([b"", b"GET / HTTP/1.1\r\n\r\n", b"\xff" + bytes(8) + b"\x7f\x03"][number % 3])
        await expect_service(peer(zmq.DEALER, server.endpoint), eventually)
        for connection in raw:
            connection.close()


async def test_a_fault_of_the_consumer_reaches_the_loop_and_the_next_request_is_served(
    endpoint: str,
    dealer: Callable[..., Peer],
    eventually: Eventually,
    loop_faults: list[dict[str, Any]],
) -> None:
    ids: list[str] = []

    def fail(_: bytes, body: dict[str, Any]) -> None:
        ids.append(body["id"])
        raise ArithmeticError(body["id"])

    with RequestServer(endpoint, fail):
        client = dealer()
        for number in "12":
            client.socket.send(encode(HELLO | {"id": number}))
        await eventually(lambda: ids == ["1", "2"])
    assert [str(fault["exception"]) for fault in loop_faults] == ["1", "2"]
    loop_faults.clear()
