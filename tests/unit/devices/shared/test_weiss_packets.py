"""Packets of the Weiss controllers: the checksum against its definition, and wrong lengths."""

from __future__ import annotations

import random

import pytest

from slipd.devices.shared import weiss_packets as weiss
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.weiss_packets import SEED_AFTER_PREAMBLE, SEED_WITH_PREAMBLE

LONGEST = 40


def defined(data: bytes, seed: int = SEED_AFTER_PREAMBLE) -> int:
    """Return the checksum as the drivers define it: the table of a left-shifting CCITT, used with right shifts."""
    for byte in data:
        entry = (seed ^ byte) & 0xFF
        value = entry << 8
        for _ in range(8):
            value = (value << 1 ^ 0x1021) & 0xFFFF if value & 0x8000 else value << 1
        seed = value ^ seed >> 8
    return seed


def packets(seed: int = SEED_WITH_PREAMBLE, *, bare: bool = False, text: bytes = b"") -> weiss.PacketScanner:
    def accepts(packet_id: int, size: int, payload: bytes) -> bool:
        return packet_id <= 9 and size <= LONGEST and payload[:1] != b"\xff"

    return weiss.PacketScanner(seed, accepts, 20, DecoderHealth(), bare=bare, text=text)


def test_check_values_are_the_published_ones() -> None:
    assert weiss.checksum(b"123456789") == 0x6EB4
    assert weiss.checksum(weiss.PREAMBLE) == SEED_WITH_PREAMBLE


@pytest.mark.parametrize("size", [*range(200), 977, 982, 4106])
def test_the_checksum_equals_its_definition(size: int) -> None:
    data = random.Random(size).randbytes(size)
    for seed in (SEED_AFTER_PREAMBLE, SEED_WITH_PREAMBLE, size):
        assert weiss.checksum(data, seed) == defined(data, seed)


def test_a_packet_with_a_residue_of_0_but_a_wrong_checksum_is_rejected() -> None:
    whole = weiss.encode(3, b"abc", SEED_WITH_PREAMBLE)
    body, right = whole[len(weiss.PREAMBLE) : -2], int.from_bytes(whole[-2:], "little")
    sums = [n for n in range(1 << 16) if weiss.checksum(body + n.to_bytes(2, "little"), SEED_WITH_PREAMBLE) == 0]
    assert right in sums
    assert len(sums) > 1
    for n in sums:
        _, found = packets().receive(whole[:-2] + n.to_bytes(2, "little"))
        assert len(found) == (n == right)


def test_a_bare_packet_has_no_checksum() -> None:
    bare = weiss.encode(1, b"", SEED_AFTER_PREAMBLE, bare=True)
    assert bare == bytes.fromhex("AA AA AA 01 00 00")
    stream = bare + weiss.encode(2, b"\x12", SEED_AFTER_PREAMBLE, bare=True) + bare
    assert packets(SEED_AFTER_PREAMBLE, bare=True).packets(stream) == [(1, b""), (2, b"\x12"), (1, b"")]


GOOD = weiss.encode(1, b"abc", SEED_WITH_PREAMBLE)
HEAD = weiss.PREAMBLE + b"\x01"


@pytest.mark.parametrize(
    "begin",
    [
        *(HEAD + size.to_bytes(2, "little") for size in (LONGEST + 1, 1000, 0xFFFF)),  # beyond the longest packet
        HEAD + b"\x28\x00\xff",  # a payload that is refused by its first byte
        HEAD + b"\x28\x00" + 3 * GOOD,  # a length within bounds is waited for
    ],
)
def test_L3_a_false_beginning_costs_no_packet_after_it(begin: bytes) -> None:
    assert packets().packets(begin + GOOD) == [(1, b"abc")] * (1 + begin.count(GOOD))


def test_text_between_packets_is_no_damage() -> None:
    reader = packets(text=b"boot")
    assert len(reader.packets(b"boot" + GOOD + b"boot" + GOOD + b"b\0")) == 2
    assert reader._health.bad_bytes == 1


@pytest.mark.parametrize(
    ("code", "word"), [(0, "ok"), (12, "no parameter expected"), (26, "command pending"), (31, "status 31")]
)
def test_status_numbers_have_words(code: int, word: str) -> None:
    assert weiss.status_word(code) == word
