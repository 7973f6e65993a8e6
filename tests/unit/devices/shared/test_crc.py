"""Both CRCs against their published check values and a bitwise computation."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from slipd.devices.shared import checksums

CHECK = b"123456789"


def bitwise(data: bytes, poly: int, final: int) -> int:
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ poly if value & 1 else value >> 1
    return value ^ final


def test_check_values_are_the_published_ones() -> None:
    assert (checksums.x25(CHECK), checksums.modbus(CHECK)) == (0x906E, 0x4B37)


@given(st.binary(max_size=80), st.integers(0, 0xFFFF))
def test_both_equal_the_bitwise_definition_and_only_the_right_one_matches(data: bytes, sent: int) -> None:
    right = bitwise(data, 0x8408, 0xFFFF)
    assert (checksums.x25(data), checksums.modbus(data)) == (right, bitwise(data, 0xA001, 0))
    assert checksums.x25_matches(data + sent.to_bytes(2, "little")) == (sent == right)
    assert checksums.x25_matches(data + right.to_bytes(2, "little"))
