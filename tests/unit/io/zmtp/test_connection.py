"""The protocol without sockets: valid and invalid bytes, in any pieces. Without keys; see test_mechanisms for CURVE."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.io.zmtp.connection import MOST_FRAMES, WRITE_BYTES, Connection, Event, PeerRules, State
from slipd.io.zmtp.mechanisms import MAX_HANDSHAKE_BYTES, Null
from slipd.io.zmtp.wire import (
    COMMAND,
    MORE,
    ProtocolError,
    encode_command,
    encode_frame,
    encode_greeting,
    encode_metadata,
)

RULES = PeerRules(b"ROUTER", frozenset({b"DEALER"}), max_bytes=600, max_frames=2, most_queued=5)
GREETING = encode_greeting(b"NULL", as_server=False)


def command(name: bytes, data: bytes = b"") -> bytes:
    return encode_frame(encode_command(name, data), COMMAND)


def ready(**properties: bytes) -> bytes:
    return command(b"READY", encode_metadata({name.replace("_", "-").encode(): at for name, at in properties.items()}))


OPENING = GREETING + ready(Socket_Type=b"DEALER", Identity=b"arm")


def made(rules: PeerRules = RULES) -> Connection:
    return Connection(Null(rules.kind), rules)


def events(connection: Connection, data: bytes = b"") -> list[Event | list[bytes]]:
    """Return all events of some bytes, without the one that asks for more."""
    connection.receive_data(data)
    return list(itertools.takewhile(lambda event: event is not Event.NEED_DATA, iter(connection.next_event, None)))


@pytest.fixture
def connection() -> Connection:
    """After the handshake, with all answers sent."""
    connection = made()
    assert events(connection, OPENING) == [Event.PART, Event.READY]
    connection.sent(len(connection.unsent))
    return connection


def pieces(data: bytes, cuts: list[int]) -> list[bytes]:
    ends = sorted({cut % (len(data) + 1) for cut in cuts} | {0, len(data)})
    return [data[a:b] for a, b in itertools.pairwise(ends)]


def test_the_handshake_is_that_of_the_rfc() -> None:
    connection = made()
    assert connection.unsent == bytes.fromhex("ff00000000000000017f03014e554c4c".ljust(128, "0"))
    connection.sent(64)
    assert events(connection, OPENING) == [Event.PART, Event.READY]
    assert connection.unsent == b"\x04\x29\x05READY\x0bSocket-Type\0\0\0\x06ROUTER\x08Identity\0\0\0\0"
    assert (connection.state, connection.kind, connection.route, connection.key) == (State.OPEN, b"DEALER", b"arm", b"")


@given(
    st.lists(st.lists(st.binary(max_size=600), min_size=1, max_size=3), max_size=8),
    st.lists(st.integers(0), max_size=20),
)
def test_messages_come_back_from_any_pieces(sent: list[list[bytes]], cuts: list[int]) -> None:
    connection, got = made(), []
    for piece in pieces(OPENING + b"".join(Null(b"").seal(tuple(frames)) for frames in sent), cuts):
        got += events(connection, piece)
    assert [event for event in got if isinstance(event, list)] == sent


VALID = [
    Null(b"").seal((b"a", b"", b"c")),
    command(b"PING", b"\0\0mark"),
    command(b"SUBSCRIBE", b"slip"),
    command(b"CANCEL", b"slip"),
    command(b"ERROR", b"\0"),
    command(b"LATER", b"of a later version"),
    encode_frame(bytes(300)),
    ready(Socket_Type=b"DEALER"),
    GREETING,
]
DAMAGE = st.tuples(st.integers(0), st.sampled_from([b"", b"\xff", b"\x80", b"\x06", b"\x00\x00"]), st.integers(0, 3))


@given(
    st.lists(st.sampled_from(VALID), max_size=12), st.lists(DAMAGE, max_size=4), st.lists(st.integers(0), max_size=12)
)
def test_whatever_arrives_is_an_event_or_a_protocol_error_and_little_is_kept(
    parts: list[bytes], damage: list[tuple[int, bytes, int]], cuts: list[int]
) -> None:
    data = bytearray(OPENING + b"".join(parts))
    for at, new, removed in damage:
        begin = at % (len(data) + 1)
        data[begin : begin + removed] = new
    connection, opened = made(), False
    for piece in pieces(bytes(data), cuts):
        connection.receive_data(piece)
        most_kept = len(piece) + max(MAX_HANDSHAKE_BYTES, RULES.max_bytes) + 9
        while True:
            try:
                event = connection.next_event()
            except ProtocolError:
                assert connection.state is State.CLOSED
                return
            opened = opened or event is Event.READY
            assert opened is (connection.state is State.OPEN)
            assert opened or not isinstance(event, list)
            assert not isinstance(event, list) or len(event) <= RULES.max_frames + 1
            assert len(connection.unsent) < 200
            if event is Event.NEED_DATA:
                break
        assert len(connection._received) <= most_kept


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"GET / HTTP/1.1\r\n".ljust(64), "does not speak ZMTP"),
        (b"\xfe" + GREETING[1:], "does not speak ZMTP"),
        (GREETING[:9] + b"\x7e" + GREETING[10:], "does not speak ZMTP"),
        (b"\xff" + bytes(8) + b"\x7f\x02".ljust(55, b"\0"), "must use ZMTP 3.0 or later"),
        (encode_greeting(b"CURVE", as_server=False), "another security mechanism"),
        (GREETING + encode_frame(b"early"), "must send READY first, got a message"),
        (GREETING + command(b"HELLO"), "must send READY first, got HELLO"),
        (GREETING + encode_frame(b"\x09READY", COMMAND), "a command is shorter than its name"),
        (GREETING + encode_frame(b"", COMMAND), "a command is shorter than its name"),
        (GREETING + command(b"READY", encode_metadata({b"Socket-Type": b"DEALER"})[:-1]), "truncated"),
        (GREETING + command(b"READY", b"\x0bSocket-Type\0\0\0"), "truncated"),
        (GREETING + command(b"READY", bytes(MAX_HANDSHAKE_BYTES)), "at most 1024 are allowed"),
        (GREETING + ready(), "a '' socket cannot connect here"),
        (GREETING + ready(Socket_Type=b"PUB"), "a 'PUB' socket cannot connect here"),
        (GREETING + ready(Socket_Type=b"DEALER", Identity=b"\0own"), "begins with a zero byte"),
        (GREETING + ready(Socket_Type=b"DEALER", Identity=bytes(range(1, 256)) + b"x"), "is too long"),
        (OPENING + b"\x08\x00", r"reserved flags \(0x08\)"),
        (OPENING + encode_frame(bytes(601))[:9], "a frame has 601 bytes; at most 600"),
        (OPENING + b"\x02" + (1 << 62).to_bytes(8, "big"), "at most 600"),
        (OPENING + command(b"ERROR", b"\0"), "the peer reports an error"),
        (OPENING + encode_frame(b"", MORE) * (MOST_FRAMES + 1), "more than 10000 frames"),
    ],
)
def test_who_breaks_the_protocol_is_told_apart(data: bytes, reason: str) -> None:
    connection = made()
    with pytest.raises(ProtocolError, match=reason):
        events(connection, data)
    assert connection.state is State.CLOSED
    with pytest.raises(ProtocolError):
        events(connection, command(b"PING", b"\0\0"))


def test_an_identity_and_a_frame_may_be_as_long_as_the_limit(connection: Connection) -> None:
    longest = bytes(range(1, 256))
    assert events(made(), GREETING + ready(Socket_Type=b"DEALER", Identity=longest)) == [Event.PART, Event.READY]
    assert events(connection, encode_frame(bytes(600))) == [[bytes(600)]]
    assert events(connection, encode_frame(b"", MORE) * (MOST_FRAMES - 1) + encode_frame(b"last"))[-1] == [b""] * 3


def test_of_a_long_message_the_first_frames_are_kept_and_the_next_message_is_whole(connection: Connection) -> None:
    found = events(connection, Null(b"").seal((b"0", b"1", b"2", b"3")) + Null(b"").seal((b"next",)))
    assert found == [Event.PART] * 3 + [[b"0", b"1", b"2"], [b"next"]]


def test_subscriptions_are_messages_as_before_zmtp_3_1_and_unknown_commands_are_ignored(connection: Connection) -> None:
    data = command(b"SUBSCRIBE", b"slip") + command(b"CANCEL", b"slip") + command(b"PONG") + command(b"LATER", b"x")
    assert events(connection, data) == [[b"\x01slip"], [b"\x00slip"], Event.COMMAND, Event.COMMAND]
    assert connection.unsent == b""


def test_a_ping_is_answered_with_its_context_unless_something_waits(connection: Connection) -> None:
    assert events(connection, command(b"PING", b"\0\x10" + b"0123456789abcdefg")) == [Event.COMMAND]
    assert connection.unsent == command(b"PONG", b"0123456789abcdef")
    assert events(connection, command(b"PING", b"\0\0again") * 3) == [Event.COMMAND] * 3
    assert connection.unsent == command(b"PONG", b"0123456789abcdef")


@pytest.mark.parametrize("drops_oldest", [False, True])
@given(steps=st.lists(st.one_of(st.none(), st.integers(0, 100_000)), max_size=60))
def test_a_full_queue_drops_the_new_or_the_oldest_and_what_is_sent_is_whole(
    drops_oldest: bool, steps: list[int | None]
) -> None:
    """None: a message is sent; a number: so many bytes pass to the kernel."""
    connection = made(PeerRules(b"XPUB", frozenset(), 100, most_queued=5, drops_oldest=drops_oldest))
    connection.sent(64)
    kept: list[bytes] = []
    wire = bytearray()
    for number, step in enumerate(steps):
        if step is None:
            message = number.to_bytes(2, "big") * 10_000
            full = len(kept) == 5
            assert connection.send((message,)) is (drops_oldest or not full or not wire)
            kept = [*kept, message][-5:] if drops_oldest else [*kept, message][:5]
        else:
            assert connection.sent(min(step, len(wire))) is bool(wire[step:] or kept)
            del wire[:step]
        while kept and len(wire) < len(connection.unsent):
            wire += encode_frame(kept.pop(0))
        assert connection.unsent == bytes(wire)
        assert len(wire) < WRITE_BYTES + 20_009
        assert connection.waiting == len(kept) + bool(wire)
