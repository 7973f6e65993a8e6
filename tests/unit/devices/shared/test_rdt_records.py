"""RDT records: without sync and checksum, only consistency from one record to the next shows where one begins."""

from __future__ import annotations

import random
from collections.abc import Iterable

import numpy as np
import pytest

from slipd.devices.shared import rdt_records as rdt
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.tools.sim import emulated_rdt as sim

RESERVED = 0xFFFF_0000
SPAN = 1 << 32
COUNTS = (12_345_678, -2_500_000, 98_100_000, 150_000, -42_000, 7)


def record(number: int, status: int = 0, ticks: int | None = None) -> bytes:
    """Return a record of a 1 kHz stream; its second count is a thousand times its number."""
    return sim.encode_record(
        (COUNTS[0], 1000 * number, *COUNTS[2:]), number, 7 * number if ticks is None else ticks, status
    )


def read(*pieces: bytes) -> tuple[list[int], DecoderHealth]:
    """Return the numbers of the returned records, and the counts."""
    health = DecoderHealth()
    records = rdt.RecordScanner(health, RESERVED)
    return [int(row[1]) // 1000 for piece in pieces for row in records.records(piece)[1]], health


def test_requests_are_written_and_read() -> None:
    start = bytes.fromhex("12 34 00 02 00 00 00 00")
    assert rdt.encode_request(rdt.START) == start
    assert sim.parse_request(rdt.encode_request(0x82, 5)) == (0x82, 5)
    assert [sim.parse_request(wrong) for wrong in (start + b"\0", bytes(8))] == [None, None]


def scanner() -> rdt.RecordScanner:
    return rdt.RecordScanner(DecoderHealth(), RESERVED)


def stream(*numbers: int) -> list[bytes]:
    return [record(number) for number in numbers]


LAST = SPAN - 1
ODD = 0x0004_0000
GARBAGE = b"\xff" + random.Random(7).randbytes(79)
READ: dict[str, tuple[list[bytes], list[int], DecoderHealth]] = {
    "a lone record is accepted at the start of a stream": (stream(7), [7], DecoderHealth()),
    "an empty datagram gives nothing": ([*stream(1, 2), b"", *stream(3)], [1, 2, 3], DecoderHealth()),
    "a gap waits for the record after it": (stream(1, 5), [1], DecoderHealth()),
    "a gap is accepted with the record after it": (stream(1, 5, 6), [1, 5, 6], DecoderHealth(lost=3)),
    "if every second datagram is lost, the others are returned": (
        stream(*range(1, 100, 2)),
        list(range(1, 98, 2)),
        DecoderHealth(lost=48),
    ),
    "a repeated and a late record are not returned": (
        stream(8, 9, 9, 10, 8, 9, 11, 12),
        [8, 9, 10, 11, 12],
        DecoderHealth(duplicates=3),
    ),
    "an overtaken datagram is dropped whole and lost nowhere else": (
        [b"".join(stream(*range(40 * block + 1, 40 * block + 41))) for block in (0, 2, 1, 3, 4)],
        [*range(1, 41), *range(81, 201)],
        DecoderHealth(lost=40, duplicates=40),
    ),
    "a start is a restart and not a loss": (
        stream(900, 901, 1, 2, 3),
        [900, 901, 1, 2, 3],
        DecoderHealth(restarts=1),
    ),
    "a start whose first records are lost waits for the fourth": (
        [record(number, ticks=70 * step) for step, number in enumerate((900, 901, 4, 5, 6))],
        [900, 901],
        DecoderHealth(),
    ),
    "and is accepted with it": (
        [record(number, ticks=70 * step) for step, number in enumerate((900, 901, 4, 5, 6, 7))],
        [900, 901, 4, 5, 6, 7],
        DecoderHealth(restarts=1),
    ),
    "the number wraps to zero": (
        [sim.encode_record((0, 1000 * step, 0, 0, 0, 0), LAST + step, 70 + step) for step in (-1, 0, 1, 2)],
        [-1, 0, 1, 2],
        DecoderHealth(),
    ),
    "reserved bits are accepted when they are steady": (
        [record(number, ODD) for number in range(1, 5)],
        [1, 2, 3, 4],
        DecoderHealth(),
    ),
    "also after records without them": (
        [*stream(1, 2), *(record(number, ODD) for number in (3, 4, 5))],
        [1, 2, 3, 4, 5],
        DecoderHealth(),
    ),
    "but not of a single record": (
        [*stream(1, 2), record(3, ODD), *stream(4, 5, 6, 7)],
        [1, 2, 4, 5, 6, 7],
        DecoderHealth(bad=1, bad_bytes=36, lost=1),
    ),
    **{
        f"bit {bit} of a number costs that record alone": (
            [*stream(*range(995, 1000)), sim.encode_record(COUNTS, 1000 ^ 1 << bit, 7000), *stream(*range(1001, 1006))],
            [*range(995, 1000), *range(1001, 1006)],
            DecoderHealth(lost=1, bad=1, bad_bytes=36),
        )
        for bit in range(32)
    },
    **{
        f"after {size} bytes of garbage at the very start four records confirm each other": (
            [GARBAGE[:size], *stream(100, 101, 102, 103)],
            [100, 101, 102, 103],
            DecoderHealth(bad=max(1, (size + 18) // 36), bad_bytes=size),
        )
        for size in range(1, 80)
    },
    "three of them do not": ([GARBAGE, *stream(100, 101, 102)], [], DecoderHealth(bad=2, bad_bytes=80)),
}


@pytest.mark.parametrize("name", READ)
def test_D3_L2_L3_a_stream_gives_these_records_and_counts(name: str) -> None:
    pieces, numbers, health = READ[name]
    assert read(*pieces) == (numbers, health)


def test_L3_noise_yields_no_record_between_good_ones() -> None:
    assert read(record(1), random.Random(6).randbytes(100_000), *stream(2, 3, 4, 5))[0] == [1, 2, 3, 4, 5]


def test_L3_the_counts_of_a_resting_sensor_are_not_mistaken_for_records() -> None:
    rng = np.random.default_rng(9)
    rest = b"".join(sim.encode_record(rng.integers(-2, 3, size=6).tolist(), n, n) for n in range(10, 400))
    for start in range(1, 36):
        heads, _ = scanner().records(b"\xff\xff" + rest[start:])
        assert [clock for clock, _ in heads] == list(range(11, 400))


def test_L2_lost_or_added_bytes_cost_one_record_and_the_next_at_most() -> None:
    rng = random.Random(4)
    for _ in range(2000):
        hit, at, count = record(103), rng.randrange(36), rng.randrange(1, 30)
        flipped = bytes((hit[at] ^ 1 << rng.randrange(8),))
        change = rng.choice((hit[at + count :], rng.randbytes(count) + hit[at:], flipped + hit[at + 1 :]))
        spoilt = hit[:at] + change
        numbers, health = read(b"".join((*stream(101, 102), spoilt, *stream(*range(104, 109)))))
        assert (numbers[:2], numbers[-4:]) == ([101, 102], [105, 106, 107, 108]), spoilt.hex()
        assert (health.restarts, health.lost <= 2) == (0, True)


def test_many_records_come_from_one_piece_with_all_their_counts_which_own_their_memory() -> None:
    records = scanner()
    heads, counts = records.records(record(1) + record(2, status=5))
    assert heads == [(7, 0), (14, 5)]
    assert counts.tolist() == [[COUNTS[0], 1000 * number, *COUNTS[2:]] for number in (1, 2)]
    _, later = records.records(record(3))
    counts[:] = 0
    assert (later[0, 1], later.dtype) == (3000, np.float64)


def test_whole_datagrams_are_read_without_a_search_and_their_heads_are_unsigned(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    records = scanner()
    middle, status = SPAN // 2, 0x8001_0000
    sent = [sim.encode_record((n, 0, 0, 0, 0, 0), middle + n, middle + 7 * n, status) for n in range(20)]
    assert len(records.records(b"".join(sent[:4]))[0]) == 4
    monkeypatch.setattr(records, "_search", None)
    for numbers in (range(4, 11), range(11, 20)):
        heads, counts = records.records(b"".join(sent[n] for n in numbers))
        assert heads == [(middle + 7 * n, status) for n in numbers]
        assert counts[:, 0].tolist() == [*numbers]


@pytest.mark.parametrize(
    ("numbers", "clock"),
    [
        (range(1, 5), (SPAN - 14, SPAN - 7, SPAN, SPAN + 7)),
        (range(1, 7), (SPAN - 7, SPAN + 8, *range(SPAN + 7, SPAN + 35, 7))),  # one bit of the second was damaged
        ((8, 1, 2), (5_000_000, 70, 77)),
    ],
)
def test_the_clock_is_unwrapped_and_a_reset_starts_again(numbers: Iterable[int], clock: tuple[int, ...]) -> None:
    records = scanner()
    pieces = [record(number, ticks=ticks) for number, ticks in zip(numbers, clock, strict=True)]
    assert tuple(head[0] for piece in pieces for head in records.records(piece)[0]) == clock


def test_a_freshly_opened_stream_begins_at_any_number_and_drops_a_partial_record() -> None:
    health = DecoderHealth()
    records = rdt.RecordScanner(health, RESERVED)
    records.records(record(9) + record(10)[:20])
    records.forget()
    assert len(records.records(record(500))[0]) == 1
    assert health == DecoderHealth(bad=1, bad_bytes=20)


@pytest.mark.parametrize("place", range(6))
@pytest.mark.parametrize("rail", [-(1 << 31), (1 << 31) - 1])
def test_N3_a_count_at_the_end_of_its_range_is_marked(place: int, rail: int) -> None:
    counts = [*COUNTS[:place], rail, *COUNTS[place + 1 :]]
    heads, values = scanner().records(record(1) + sim.encode_record(counts, 2, 14, 3) + record(3))
    assert [status for _, status in heads] == [0, 3 | rdt.AT_RAIL, 0]
    assert values[1, place] == rail


def test_D3_the_clock_of_a_late_record_moves_none_after_it() -> None:
    """Of two overtaken datagrams, the second is late by its numbers alone."""
    first = [sim.encode_record(COUNTS, SPAN - 3 + step, SPAN - 21 + 7 * step) for step in range(4)]
    second = [record(n, ticks=7 * n + 11) for n in (37, 38)]
    later = [[record(n, ticks=7 * n + 11) for n in (n, n + 1)] for n in (39, 41, 43)]
    records = scanner()
    sent = [[record(37), record(38)], first, second, *later]
    clocks = [clock for datagram in sent for clock, _ in records.records(b"".join(datagram))[0]]
    assert clocks == [259, 266, *(7 * n + 11 for n in range(39, 45))]
