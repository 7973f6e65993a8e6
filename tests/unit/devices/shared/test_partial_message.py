"""Measurement of messages that may not have arrived completely."""

from __future__ import annotations

import pytest

from slipd.devices.shared.msgpack_messages import Malformed, arrived, byte_at, message_length


def counted_end(buffer: bytes, at: int) -> int:
    """Find the end of a message that begins with the number of its other bytes."""
    return arrived(buffer, at + 1 + byte_at(buffer, at))


@pytest.mark.parametrize(
    ("buffer", "length"),
    [(b"", 0), (b"\x03ab", 0), (b"\x03abc", 4), (b"\x03abcd", 4), (b"\x04abcd", -1), (b"\x09abcd", -1)],
)
def test_a_message_has_a_length_or_is_incomplete_or_malformed(buffer: bytes, length: int) -> None:
    assert message_length(counted_end, b"--" + buffer, 2, 4) == length


def test_a_malformed_message_has_no_length() -> None:
    def refuse(buffer: bytes, at: int) -> int:
        raise Malformed

    assert message_length(refuse, b"ab", 0, 4) == -1
