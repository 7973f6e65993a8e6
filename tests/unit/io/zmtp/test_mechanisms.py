"""CURVE against a client written here from the RFC: valid handshakes, and everything that must be refused.

Handshakes of libzmq clients are tested with the endpoints (`tests/unit/io/test_authentication.py`).
"""

from __future__ import annotations

import struct
from functools import partial

import pytest
from nacl import bindings as sodium
from zmq.utils import z85

from slipd.io.zmtp.connection import Connection, Event, PeerRules, State
from slipd.io.zmtp.mechanisms import Curve, KeyRefusedError
from slipd.io.zmtp.wire import (
    COMMAND,
    MORE,
    ProtocolError,
    encode_command,
    encode_frame,
    encode_greeting,
    encode_metadata,
    next_frame,
)

SERVER = sodium.crypto_box_seed_keypair(bytes(32))
CLIENT = sodium.crypto_box_seed_keypair(b"c" * 32)
OTHER = sodium.crypto_box_seed_keypair(b"o" * 32)
SHORT = sodium.crypto_box_seed_keypair(b"s" * 32)
METADATA = encode_metadata({b"Socket-Type": b"SUB"})


def bodies(wire: bytes) -> list[tuple[int, bytes]]:
    return list(iter(partial(next_frame, bytearray(wire), 10_000), None))


class Client:
    """The client side, of which every part can be made wrong."""

    def __init__(self, server_public: bytes = SERVER[0]) -> None:
        self.opening = sodium.crypto_box_beforenm(server_public, SHORT[1])
        self.shared = self.cookie = self.short_server = b""

    def hello(self, number: int = 1) -> bytes:
        nonce = struct.pack(">Q", number)
        box = sodium.crypto_box_afternm(bytes(64), b"CurveZMQHELLO---" + nonce, self.opening)
        return b"\x01\x00" + bytes(72) + SHORT[0] + nonce + box

    def welcome(self, wire: bytes) -> None:
        ((flags, body),) = bodies(wire)
        assert (flags, body[:8]) == (COMMAND, b"\x07WELCOME")
        plain = sodium.crypto_box_open_afternm(body[24:], b"WELCOME-" + body[8:24], self.opening)
        self.short_server, self.cookie = plain[:32], plain[32:]
        self.shared = sodium.crypto_box_beforenm(self.short_server, SHORT[1])

    def initiate(
        self,
        number: int = 2,
        *,
        key: tuple[bytes, bytes] = CLIENT,
        claimed: bytes = CLIENT[0],
        vouched: bytes = SHORT[0] + SERVER[0],
        cookie: bytes = b"",
        cut: int = 0,
    ) -> bytes:
        nonce, vouch_nonce = struct.pack(">Q", number), bytes(16)
        vouch = sodium.crypto_box(vouched, b"VOUCH---" + vouch_nonce, self.short_server, key[1])
        plain = claimed + vouch_nonce + vouch + METADATA
        box = sodium.crypto_box_afternm(plain[: len(plain) - cut], b"CurveZMQINITIATE" + nonce, self.shared)
        return (cookie or self.cookie) + nonce + box

    def seal(self, number: int, body: bytes, flags: int = 0) -> bytes:
        nonce = struct.pack(">Q", number)
        return (
            b"\x07MESSAGE"
            + nonce
            + sodium.crypto_box_afternm(bytes((flags,)) + body, b"CurveZMQMESSAGEC" + nonce, self.shared)
        )


@pytest.fixture
def server() -> Curve:
    return Curve(b"XPUB", SERVER[1], {z85.encode(CLIENT[0])})


@pytest.fixture
def client(server: Curve) -> Client:
    """After the WELCOME."""
    client = Client()
    client.welcome(server.handshake(client.hello()))
    return client


def test_a_key_that_is_proved_is_known_and_both_sides_understand_each_other(server: Curve, client: Client) -> None:
    assert server.properties == {}
    ((_, ready),) = bodies(server.handshake(client.initiate()))
    metadata = sodium.crypto_box_open_afternm(ready[14:], b"CurveZMQREADY---" + ready[6:14], client.shared)
    assert metadata.startswith(b"\x0bSocket-Type\x00\x00\x00\x04XPUB")
    assert server.key == z85.encode(CLIENT[0])
    assert server.properties == {b"socket-type": b"SUB"}
    for number, flags, content, body in (
        (3, 0, 0, b"\x01slip"),
        (9, 1, MORE, b"part"),
        (10, 2, COMMAND, b"\x04PING\0\0"),
    ):
        assert server.open(0, client.seal(number, body, flags)) == (content, body)
    sealed = bodies(server.seal((b"topic", b"payload")))
    assert [
        sodium.crypto_box_open_afternm(body[16:], b"CurveZMQMESSAGES" + body[8:16], client.shared) for _, body in sealed
    ] == [b"\x01topic", b"\x00payload"]
    assert len({body[8:16] for _, body in [*sealed, *bodies(server.seal((b"again",)))]}) == 3


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"key": OTHER}, "does not open"),  # claims the key of another, whose secret it does not have
        ({"vouched": OTHER[0] + SERVER[0]}, "does not vouch"),  # what the owner of the key vouched for elsewhere
        ({"vouched": SHORT[0] + OTHER[0]}, "does not vouch"),
        ({"number": 1}, "used before"),  # not above that of the HELLO
        ({"cookie": bytes(96)}, "another cookie"),
        ({"cut": len(METADATA) + 1}, "truncated"),
        ({"cut": 5}, "truncated"),
    ],
    ids=["stolen key", "another connection", "another server", "old nonce", "cookie", "cut short", "cut metadata"],
)
def test_who_does_not_prove_the_key_is_refused(
    wrong: dict[str, object], reason: str, server: Curve, client: Client
) -> None:
    with pytest.raises(ProtocolError, match=reason):
        server.handshake(client.initiate(**wrong))  # type: ignore[arg-type]
    assert (server.key, server.properties) == (b"", {})


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "not that of CURVE"),
        (b"\x01\x00", "not that of CURVE"),
        (b"\x02\x00".ljust(194, b"\0"), "not that of CURVE"),
        (b"\x01\x00".ljust(194, b"\0"), "used before"),
        # with a key of low order, the shared secret is known to everybody
        (b"\x01\x00".ljust(113, b"\0") + b"\x01" + bytes(80), "does not open"),
        (Client(OTHER[0]).hello(), "does not open"),  # it has the key of another daemon
    ],
)
def test_an_invalid_hello_is_refused(data: bytes, reason: str, server: Curve) -> None:
    with pytest.raises(ProtocolError, match=reason):
        server.handshake(data)


def test_a_frame_that_came_before_or_was_touched_or_is_not_sealed_is_refused(server: Curve, client: Client) -> None:
    server.handshake(client.initiate())
    first = client.seal(5, b"once")
    assert server.open(0, first) == (0, b"once")
    touched = bytearray(client.seal(6, b"six"))
    touched[-1] ^= 1
    for wrong in (first, client.seal(4, b"older"), bytes(touched), b"plain", b"", b"\x07MESSAGE" + bytes(8)):
        with pytest.raises(ProtocolError):
            server.open(0, wrong)
    assert server.open(0, client.seal(7, b"")) == (0, b"")


GREETING = encode_greeting(b"CURVE", as_server=False)


def wire_of(name: bytes, data: bytes) -> bytes:
    return encode_frame(encode_command(name, data), COMMAND)


@pytest.fixture
def connection(server: Curve) -> Connection:
    """After its greeting was sent."""
    connection = Connection(server, PeerRules(b"XPUB", frozenset({b"SUB"}), max_bytes=4))
    assert connection.unsent == encode_greeting(b"CURVE", as_server=True)
    connection.sent(64)
    return connection


@pytest.fixture
def greeted(connection: Connection) -> Client:
    """The client of the connection, after the WELCOME."""
    client = Client()
    connection.receive_data(GREETING + wire_of(b"HELLO", client.hello()))
    assert [connection.next_event() for _ in range(3)] == [Event.PART, Event.PART, Event.NEED_DATA]
    client.welcome(connection.unsent)
    return client


def test_a_connection_with_keys_takes_hello_initiate_and_sealed_frames_and_nothing_else(
    connection: Connection, greeted: Client
) -> None:
    assert connection.state is State.INITIATE
    connection.receive_data(wire_of(b"INITIATE", greeted.initiate()) + encode_frame(greeted.seal(3, b"slip")))
    assert [connection.next_event() for _ in range(2)] == [Event.READY, [b"slip"]]
    assert connection.key == z85.encode(CLIENT[0])
    connection.receive_data(encode_frame(b"slip"))
    with pytest.raises(ProtocolError, match="not sealed"):
        connection.next_event()


@pytest.mark.parametrize("commands", [[b"READY"], [b"INITIATE"], [b"HELLO", b"HELLO"]])
def test_a_step_of_the_handshake_out_of_order_ends_the_connection(
    commands: list[bytes], connection: Connection
) -> None:
    connection.receive_data(GREETING + b"".join(wire_of(name, Client().hello()) for name in commands))
    with pytest.raises(ProtocolError, match=r"must send (HELLO first|INITIATE after HELLO), got"):
        list(iter(connection.next_event, Event.NEED_DATA))


def test_a_client_whose_key_is_refused_gets_the_reason(connection: Connection, greeted: Client, server: Curve) -> None:
    connection.receive_data(wire_of(b"INITIATE", greeted.initiate(key=OTHER, claimed=OTHER[0])))
    with pytest.raises(KeyRefusedError, match="not allowed"):
        connection.next_event()
    assert connection.unsent.endswith(b"\x04\x0a\x05ERROR\x03400")
    assert (server.key, connection.state) == (b"", State.CLOSED)
