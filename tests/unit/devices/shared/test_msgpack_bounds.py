"""Bounds of msgpack maps and texts, whole, incomplete and malformed."""

from __future__ import annotations

import msgpack
import pytest

from slipd.devices.shared.msgpack_messages import (
    NUMBER_LENGTHS,
    Incomplete,
    Malformed,
    ValueEnd,
    arrived,
    map_end,
    message_length,
    text_end,
)


def byte_end(buffer: bytes, at: int) -> int:
    return arrived(buffer, at + 1)


KNOWN: dict[bytes, ValueEnd] = {b"force_n": byte_end, b"width_m": byte_end}
MAP = msgpack.packb({"force_n": 1, "width_m": 2})


def bounds(buffer: bytes, at: int = 0) -> tuple[int, set[bytes]]:
    return map_end(buffer, at, range(1, 3), KNOWN)


def test_a_map_has_an_end_and_keys_and_is_incomplete_before() -> None:
    assert bounds(b"-" + MAP + b"-", 1) == (1 + len(MAP), {b"force_n", b"width_m"})
    for size in range(len(MAP)):
        with pytest.raises(Incomplete):
            bounds(MAP[:size])


@pytest.mark.parametrize(
    "buffer",
    [
        b"\x81\xa7forge_n",
        b"\x81\xa7forg",
        b"\x81\xa6force_",
        b"\x81\xa8force_n",
        b"\x81\xa0",
        b"\x81\x07",
        b"\x81\xff",
        b"\x80",
        b"\x83",
        b"\x91\xa7force_n",
        b"\x82\xa7force_n\x01\xa7force_n\x01",
    ],
)
def test_a_map_with_an_unknown_or_repeated_key_or_another_size_is_malformed_at_once(buffer: bytes) -> None:
    with pytest.raises(Malformed):
        bounds(buffer)


@pytest.mark.parametrize("text", ["a", "a" * 31, "a" * 32, "a" * 40])
def test_a_text_has_an_end_and_is_incomplete_before(text: str) -> None:
    packed = msgpack.packb(text)
    assert text_end(packed + b"b", 0, 1, 40) == len(packed)
    for size in range(len(packed)):
        with pytest.raises(Incomplete):
            text_end(packed[:size], 0, 1, 40)


@pytest.mark.parametrize("value", ["", "a" * 41, 7, -7, [1], b"a"])
def test_a_text_of_another_length_or_another_type_is_malformed(value: object) -> None:
    with pytest.raises(Malformed):
        text_end(msgpack.packb(value), 0, 1, 40)


@pytest.mark.parametrize(
    "number", [0, 127, 128, 255, 256, 1 << 16, 1 << 32, -1, -32, -33, -129, -(1 << 20), -(1 << 40), 0.5]
)
def test_the_length_of_every_number_is_that_of_msgpack(number: float) -> None:
    packed = msgpack.packb(number)
    assert NUMBER_LENGTHS[packed[0]] == len(packed)


@pytest.mark.parametrize(
    ("buffer", "most", "length"),
    [
        (b"", 9, 0),
        (MAP[:-1], 19, 0),
        (MAP, 19, 19),
        (MAP + b"-", 19, 19),
        (MAP, 18, -1),
        (MAP[:-1], 18, -1),
        (b"\x80", 9, -1),
    ],
)
def test_a_message_has_a_length_or_is_incomplete_malformed_or_too_long(buffer: bytes, most: int, length: int) -> None:
    assert message_length(lambda found, at: bounds(found, at)[0], b"--" + buffer, 2, most) == length
