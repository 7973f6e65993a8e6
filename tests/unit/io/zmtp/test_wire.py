"""Bytes of ZMTP as in the RFC, in any pieces, and invalid bytes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.io.zmtp.wire import (
    COMMAND,
    MORE,
    FrameReader,
    ProtocolError,
    check_greeting,
    decode_command,
    decode_metadata,
    encode_command,
    encode_frame,
    encode_greeting,
    encode_message,
    encode_metadata,
)

NULL_GREETING = bytes.fromhex("ff00000000000000017f03014e554c4c".ljust(128, "0"))


def frames(reader: FrameReader) -> list[tuple[int, bytes]]:
    found = []
    while (frame := reader.next()) is not None:
        found.append(frame)
    return found


def test_the_greeting_is_that_of_the_rfc() -> None:
    assert encode_greeting(b"NULL", as_server=False) == NULL_GREETING
    curve = encode_greeting(b"CURVE", as_server=True)
    assert (len(curve), curve[12:17], curve[32]) == (64, b"CURVE", 1)
    check_greeting(NULL_GREETING, b"NULL")


@pytest.mark.parametrize(
    ("greeting", "reason"),
    [
        (b"GET / HTTP/1.1\r\n".ljust(64), "does not speak ZMTP"),
        (b"\xff" + bytes(8) + b"\x7f\x02".ljust(55, b"\0"), "must use ZMTP 3.0 or later"),
        (NULL_GREETING[:12] + b"PLAIN".ljust(52, b"\0"), "another security mechanism"),
        (NULL_GREETING[:12] + b"CURVE".ljust(52, b"\0"), "another security mechanism"),
    ],
)
def test_another_protocol_version_or_mechanism_is_refused(greeting: bytes, reason: str) -> None:
    with pytest.raises(ProtocolError, match=reason):
        check_greeting(greeting, b"NULL")


def test_a_short_and_a_long_frame_are_those_of_the_rfc() -> None:
    assert encode_frame(b"hi") == b"\x00\x02hi"
    assert encode_frame(b"hi", MORE) == b"\x01\x02hi"
    assert encode_frame(encode_command(b"PING", b"\0\0"), COMMAND) == b"\x04\x07\x04PING\0\0"
    assert encode_frame(bytes(255))[:2] == b"\x00\xff"
    assert encode_frame(bytes(256))[:9] == b"\x02" + (256).to_bytes(8, "big")
    assert encode_message((b"a", b"", b"b")) == b"\x01\x01a\x01\x00\x00\x01b"


@given(
    st.lists(st.tuples(st.sampled_from([0, MORE, COMMAND]), st.binary(max_size=600)), max_size=8),
    st.lists(st.integers(1, 700), min_size=1, max_size=20),
)
def test_frames_come_back_from_any_pieces(sent: list[tuple[int, bytes]], sizes: list[int]) -> None:
    data = b"".join(encode_frame(body, flags) for flags, body in sent)
    reader, got, at, turn = FrameReader(600), [], 0, 0
    while at < len(data):
        size = sizes[turn % len(sizes)]
        reader.feed(data[at : at + size])
        got += frames(reader)
        at, turn = at + size, turn + 1
    assert got == sent


def test_a_frame_that_is_too_long_is_refused_by_its_head() -> None:
    reader = FrameReader(100)
    reader.feed(encode_frame(bytes(100)) + b"\x02" + (1 << 62).to_bytes(8, "big"))
    assert reader.next() == (0, bytes(100))
    with pytest.raises(ProtocolError, match="at most 100"):
        reader.next()


@pytest.mark.parametrize("flags", [0x08, 0x10, 0x80, 0xFF])
def test_reserved_flags_are_refused(flags: int) -> None:
    reader = FrameReader(100)
    reader.feed(bytes((flags, 0)))
    with pytest.raises(ProtocolError, match="reserved"):
        reader.next()


def test_a_reader_keeps_no_more_than_a_frame_however_much_it_is_fed() -> None:
    reader = FrameReader(64_000)
    piece = encode_frame(bytes(50_000), MORE)
    for _ in range(100):
        for at in range(0, len(piece), 30_000):
            reader.feed(piece[at : at + 30_000])
            frames(reader)
            assert len(reader._data) <= len(piece) + 30_000 + 16_384


@given(st.dictionaries(st.binary(min_size=1, max_size=20).map(bytes.lower), st.binary(max_size=50), max_size=5))
def test_metadata_comes_back(properties: dict[bytes, bytes]) -> None:
    assert decode_metadata(encode_metadata(properties)) == properties


@pytest.mark.parametrize("cut", range(1, 22))
def test_truncated_metadata_is_refused(cut: int) -> None:
    data = encode_metadata({b"Socket-Type": b"DEALER"})
    with pytest.raises(ProtocolError, match="truncated"):
        decode_metadata(data[:cut])


def test_a_command_is_its_name_and_the_rest() -> None:
    assert decode_command(b"\x04PING\x00\x10abc") == (b"PING", b"\x00\x10abc")
    for body in (b"", b"\x05PING"):
        with pytest.raises(ProtocolError, match="shorter than its name"):
            decode_command(body)
