"""CURVE against a client written here from the RFC: valid handshakes, and everything that must be refused.

Handshakes of libzmq clients are tested with the endpoints (`tests/unit/io/bus/test_authentication.py`).
"""

from __future__ import annotations

import struct
from collections.abc import Callable

import pytest
from nacl import bindings as sodium
from zmq.utils import z85

from slipd.io.zmtp.mechanisms import Curve, KeyRefusedError, Null
from slipd.io.zmtp.wire import COMMAND, MORE, FrameReader, ProtocolError, encode_command, encode_metadata

SERVER = sodium.crypto_box_seed_keypair(bytes(32))
CLIENT = sodium.crypto_box_seed_keypair(b"c" * 32)
OTHER = sodium.crypto_box_seed_keypair(b"o" * 32)
SHORT = sodium.crypto_box_seed_keypair(b"s" * 32)
METADATA = encode_metadata({b"Socket-Type": b"SUB"})


def only(key: bytes) -> Callable[[bytes], bool]:
    return lambda asked: asked == z85.encode(key)


def bodies(wire: bytes) -> list[tuple[int, bytes]]:
    reader, found = FrameReader(10_000), []
    reader.feed(wire)
    while (frame := reader.next()) is not None:
        found.append(frame)
    return found


class Client:
    """The client side, of which every part can be made wrong."""

    def __init__(self, server_public: bytes = SERVER[0]) -> None:
        self.server_public = server_public
        self.shared = b""
        self.cookie = b""
        self.short_server = b""

    def hello(self, number: int = 1) -> bytes:
        nonce = struct.pack(">Q", number)
        opening = sodium.crypto_box_beforenm(self.server_public, SHORT[1])
        box = sodium.crypto_box_afternm(bytes(64), b"CurveZMQHELLO---" + nonce, opening)
        return encode_command(b"HELLO", b"\x01\x00" + bytes(72) + SHORT[0] + nonce + box)

    def welcome(self, wire: bytes) -> None:
        ((flags, body),) = bodies(wire)
        assert flags == COMMAND
        assert body[:8] == b"\x07WELCOME"
        opening = sodium.crypto_box_beforenm(self.server_public, SHORT[1])
        plain = sodium.crypto_box_open_afternm(body[24:], b"WELCOME-" + body[8:24], opening)
        self.short_server, self.cookie = plain[:32], plain[32:]
        self.shared = sodium.crypto_box_beforenm(self.short_server, SHORT[1])

    def initiate(
        self,
        number: int = 2,
        *,
        key: tuple[bytes, bytes] = CLIENT,
        claimed: bytes = CLIENT[0],
        vouched: bytes = SHORT[0] + SERVER[0],
        metadata: bytes = METADATA,
        cut: int = 0,
    ) -> bytes:
        nonce, vouch_nonce = struct.pack(">Q", number), bytes(16)
        vouch = sodium.crypto_box(vouched, b"VOUCH---" + vouch_nonce, self.short_server, key[1])
        plain = claimed + vouch_nonce + vouch + metadata
        box = sodium.crypto_box_afternm(plain[: len(plain) - cut], b"CurveZMQINITIATE" + nonce, self.shared)
        return encode_command(b"INITIATE", self.cookie + nonce + box)

    def seal(self, number: int, body: bytes, flags: int = 0) -> bytes:
        nonce = struct.pack(">Q", number)
        return (
            b"\x07MESSAGE"
            + nonce
            + sodium.crypto_box_afternm(bytes((flags,)) + body, b"CurveZMQMESSAGEC" + nonce, self.shared)
        )


@pytest.fixture
def server() -> Curve:
    return Curve(b"XPUB", SERVER[1], only(CLIENT[0]))


@pytest.fixture
def client(server: Curve) -> Client:
    """After the WELCOME."""
    client = Client()
    client.welcome(server.handshake(client.hello()))
    return client


def test_a_key_that_is_proved_is_known_and_both_sides_understand_each_other(server: Curve, client: Client) -> None:
    assert server.properties is None
    ((_, ready),) = bodies(server.handshake(client.initiate()))
    metadata = sodium.crypto_box_open_afternm(ready[14:], b"CurveZMQREADY---" + ready[6:14], client.shared)
    assert metadata.startswith(b"\x0bSocket-Type\x00\x00\x00\x04XPUB")
    assert server.key == z85.encode(CLIENT[0])
    assert server.properties == {b"socket-type": b"SUB"}
    assert server.open(0, client.seal(3, b"\x01slip")) == (0, b"\x01slip")
    assert server.open(0, client.seal(9, b"part", 1)) == (MORE, b"part")
    assert server.open(0, client.seal(10, b"\x04PING\0\0", 2)) == (COMMAND, b"\x04PING\0\0")
    sealed = bodies(server.seal((b"topic", b"payload")))
    opened = [
        sodium.crypto_box_open_afternm(body[16:], b"CurveZMQMESSAGES" + body[8:16], client.shared) for _, body in sealed
    ]
    assert opened == [b"\x01topic", b"\x00payload"]
    assert len({body[8:16] for _, body in [*sealed, *bodies(server.seal((b"again",)))]}) == 3


def test_a_key_that_is_not_allowed_is_refused_with_an_error(server: Curve, client: Client) -> None:
    with pytest.raises(KeyRefusedError, match="not allowed") as raised:
        server.handshake(client.initiate(key=OTHER, claimed=OTHER[0]))
    assert raised.value.reply == b"\x04\x0a\x05ERROR\x03400"
    assert (server.key, server.properties) == (b"", None)


@pytest.mark.parametrize(
    "wrong",
    [
        {"key": OTHER},  # claims the key of another, whose secret it does not have
        {"vouched": OTHER[0] + SERVER[0]},  # what the owner of the key vouched for elsewhere
        {"vouched": SHORT[0] + OTHER[0]},
        {"number": 1},  # not above that of the HELLO
        {"cut": len(METADATA) + 1},
        {"cut": 5},
    ],
    ids=["stolen key", "another connection", "another server", "old nonce", "cut short", "cut metadata"],
)
def test_who_does_not_prove_the_key_is_refused(wrong: dict[str, object], server: Curve, client: Client) -> None:
    with pytest.raises(ProtocolError):
        server.handshake(client.initiate(**wrong))  # type: ignore[arg-type]
    assert (server.key, server.properties) == (b"", None)


def test_the_cookie_of_another_connection_is_refused(server: Curve, client: Client) -> None:
    client.cookie = bytes(96)
    with pytest.raises(ProtocolError, match="another cookie"):
        server.handshake(client.initiate())


def test_a_client_with_the_key_of_another_daemon_is_refused(server: Curve) -> None:
    with pytest.raises(ProtocolError, match="does not open"):
        server.handshake(Client(OTHER[0]).hello())


@pytest.mark.parametrize("body", [b"", b"\x05HELLO", b"\x05READY", b"\x05HELLO\x02\x00".ljust(200, b"\0"), bytes(200)])
def test_an_invalid_hello_is_refused(body: bytes, server: Curve) -> None:
    with pytest.raises(ProtocolError):
        server.handshake(body)


def test_a_key_of_low_order_is_refused(server: Curve) -> None:
    """With such a key the shared secret is known to everybody."""
    with pytest.raises(ProtocolError):
        server.handshake(b"\x05HELLO\x01\x00".ljust(80, b"\0") + bytes(32) + b"\0" * 7 + b"\x01" + bytes(80))


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


def test_without_keys_a_peer_states_its_socket_type() -> None:
    null = Null(b"PULL")
    reply = null.handshake(encode_command(b"READY", METADATA))
    assert null.properties == {b"socket-type": b"SUB"}
    assert bodies(reply)[0][1].startswith(b"\x05READY\x0bSocket-Type\x00\x00\x00\x04PULL")
    assert null.open(MORE, b"as it is") == (MORE, b"as it is")
    assert null.seal((b"a", b"b")) == b"\x01\x01a\x00\x01b"
    with pytest.raises(ProtocolError, match="READY"):
        Null(b"PULL").handshake(encode_command(b"HELLO"))
