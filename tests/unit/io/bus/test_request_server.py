"""Requests are delivered, replies return to their client, and what is no request is refused."""

from __future__ import annotations

import os
import random
import socket
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest
import zmq
from answering_server import HELLO, Answering, expect_service, replies

from slipd.io.bus.request_server import RequestServer
from slipd.io.zmtp.endpoint import Access
from slipd_client.messages import PROTOCOL_VERSION, REQUEST_LIMITS, MessageError, decode, encode

if TYPE_CHECKING:
    from loop_waits import Eventually
    from zeromq_peers import Peer

pytestmark = pytest.mark.usefixtures("loop_faults")


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
