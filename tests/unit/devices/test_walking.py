"""What both kinds of pushed messages have in common: where one ends, and whether it can still become one."""

from __future__ import annotations

import pytest

from slipd.devices.walking import Cut, Wrong, byte_at, known_key, length_of, within

KNOWN = {b"force_n", b"width_m"}


def to_end(buffer: bytes, at: int) -> int:
    return within(buffer, at + 1 + byte_at(buffer, at))


@pytest.mark.parametrize(
    ("buffer", "length"),
    [(b"", 0), (b"\x03ab", 0), (b"\x03abc", 4), (b"\x03abcd", 4), (b"\x04abcd", -1), (b"\x09abcd", -1)],
)
def test_a_message_is_measured_waited_for_or_none(buffer: bytes, length: int) -> None:
    assert length_of(to_end, b"--" + buffer, 2, 4) == length


def test_what_is_wrong_is_no_message() -> None:
    assert length_of(lambda buffer, at: known_key(buffer, at, KNOWN)[1], b"\xa1v", 0, 4) == -1


def test_a_key_is_read_to_its_end() -> None:
    assert known_key(b"-\xa7force_n-", 1, KNOWN) == (b"force_n", 9)


@pytest.mark.parametrize("size", range(8))
def test_a_key_that_is_cut_is_waited_for(size: int) -> None:
    with pytest.raises(Cut):
        known_key(b"\xa7width_m"[:size], 0, KNOWN)


@pytest.mark.parametrize(
    "buffer", [b"\xa7forge_n", b"\xa7forg", b"\xa6force_", b"\xa8force_n", b"\xa0", b"\x07", b"\xff"]
)
def test_a_key_that_is_none_is_told_at_once(buffer: bytes) -> None:
    with pytest.raises(Wrong):
        known_key(buffer, 0, KNOWN)
