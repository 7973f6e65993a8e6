"""RDT records: without sync and checksum, only consistency from one record to the next shows where one begins."""

from __future__ import annotations

import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.devices.shared import rdt_records as rdt
from slipd.devices.shared.device_interface import DecoderHealth

RESERVED = 0xFFFF_0000
SPAN = 1 << 32
COUNTS = (12_345_678, -2_500_000, 98_100_000, 150_000, -42_000, 7)


def record(number: int, status: int = 0, ticks: int | None = None) -> bytes:
    """Return a record of a 1 kHz stream; its second count is a thousand times its number."""
    return rdt.encode_record(
        (COUNTS[0], 1000 * number, *COUNTS[2:]), number, 7 * number if ticks is None else ticks, status
    )


def read(*pieces: bytes) -> tuple[list[int], DecoderHealth]:
    """Return the numbers of the returned records, and the counts."""
    health = DecoderHealth()
    records = rdt.RecordScanner(health, RESERVED)
    return [int(row[1]) // 1000 for piece in pieces for row in records.receive(piece)[1]], health


def ticks(*pieces: bytes) -> list[int]:
    records = rdt.RecordScanner(DecoderHealth(), RESERVED)
    return [head[0] for piece in pieces for head in records.receive(piece)[0]]


def test_requests_are_written_and_read() -> None:
    assert rdt.encode_request(rdt.START).hex(" ") == "12 34 00 02 00 00 00 00"
    assert rdt.encode_request(rdt.STOP).hex(" ") == "12 34 00 00 00 00 00 00"
    assert rdt.parse_request(rdt.encode_request(0x82, 5)) == (0x82, 5)
    assert rdt.parse_request(rdt.encode_request(rdt.START) + b"\0") is None
    assert rdt.parse_request(bytes(8)) is None


def test_a_lone_record_is_accepted_at_the_start_of_a_stream() -> None:
    assert read(record(7)) == ([7], DecoderHealth())


def test_an_empty_datagram_gives_nothing() -> None:
    assert read(record(1), record(2), b"", record(3)) == ([1, 2, 3], DecoderHealth())


def test_many_records_come_from_one_piece_with_all_their_counts() -> None:
    records = rdt.RecordScanner(DecoderHealth(), RESERVED)
    heads, counts = records.receive(record(1) + record(2, status=5))
    assert heads == [(7, 0), (14, 5)]
    assert counts.tolist() == [[COUNTS[0], 1000 * number, *COUNTS[2:]] for number in (1, 2)]


def test_whole_datagrams_are_read_without_a_search_and_their_heads_are_unsigned(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    records = rdt.RecordScanner(DecoderHealth(), RESERVED)
    middle, status = SPAN // 2, 0x8001_0000
    stream = [rdt.encode_record((n, 0, 0, 0, 0, 0), middle + n, middle + 7 * n, status) for n in range(10)]
    assert len(records.receive(b"".join(stream[:4]))[0]) == 4
    monkeypatch.setattr(records, "_search", None)
    for numbers in (range(4, 7), range(7, 10)):
        heads, counts = records.receive(b"".join(stream[n] for n in numbers))
        assert heads == [(middle + 7 * n, status) for n in numbers]
        assert counts[:, 0].tolist() == [*numbers]


def test_D3_a_gap_is_accepted_with_the_record_after_it() -> None:
    assert read(record(1), record(5)) == ([1], DecoderHealth())
    assert read(record(1), record(5), record(6)) == ([1, 5, 6], DecoderHealth(lost=3))


def test_D3_if_every_second_datagram_is_lost_the_others_are_returned() -> None:
    numbers, health = read(*(record(number) for number in range(1, 100, 2)))
    assert numbers == list(range(1, 98, 2))
    assert health.lost == 48


def test_D3_a_repeated_and_a_late_record_are_not_returned() -> None:
    late = [record(8), record(9), record(9), record(10), record(8), record(11), record(12)]
    assert read(*late) == ([8, 9, 10, 11, 12], DecoderHealth(duplicates=2))


def test_D3_an_overtaken_datagram_is_dropped_whole_and_lost_nowhere_else() -> None:
    datagrams = [b"".join(record(40 * block + step) for step in range(1, 41)) for block in range(5)]
    numbers, health = read(*(datagrams[block] for block in (0, 2, 1, 3, 4)))
    assert numbers == [*range(1, 41), *range(81, 201)]
    assert health == DecoderHealth(lost=40, duplicates=40)


def test_D3_a_start_is_a_restart_and_not_a_loss() -> None:
    stream = [record(number) for number in (900, 901, 1, 2, 3)]
    assert read(*stream) == ([900, 901, 1, 2, 3], DecoderHealth(restarts=1))


def test_D3_a_start_whose_first_records_are_lost_is_accepted_by_four() -> None:
    stream = [record(number, ticks=70 * step) for step, number in enumerate((900, 901, 4, 5, 6, 7))]
    assert read(*stream[:-1])[0] == [900, 901]
    assert read(*stream) == ([900, 901, 4, 5, 6, 7], DecoderHealth(restarts=1))


def test_D3_the_number_wraps_to_zero() -> None:
    last = (1 << 32) - 1
    health = DecoderHealth()
    records = rdt.RecordScanner(health, RESERVED)
    stream = b"".join(rdt.encode_record(COUNTS, last + step, 70 + step) for step in (-1, 0, 1, 2))
    assert len(records.receive(stream)[0]) == 4
    assert health == DecoderHealth()


def test_the_clock_is_unwrapped_and_a_reset_starts_again() -> None:
    top = 1 << 32
    steps = (top - 14, top - 7, top, top + 7)
    assert ticks(*(record(n, ticks=at) for n, at in enumerate(steps, 1))) == list(steps)
    steps = (top - 7, top + 8, *range(top + 7, top + 35, 7))  # one bit of the second was damaged
    assert ticks(*(record(n, ticks=at) for n, at in enumerate(steps, 1))) == list(steps)
    assert ticks(record(8, ticks=5_000_000), record(1, ticks=70), record(2, ticks=77)) == [5_000_000, 70, 77]


def test_a_freshly_opened_stream_begins_at_any_number_and_drops_a_partial_record() -> None:
    health = DecoderHealth()
    records = rdt.RecordScanner(health, RESERVED)
    records.receive(record(9) + record(10)[:20])
    records.forget()
    assert len(records.receive(record(500))[0]) == 1
    assert health == DecoderHealth(bad=1, bad_bytes=20)


def test_reserved_bits_are_accepted_when_they_are_steady() -> None:
    odd = 0x0004_0000
    assert read(*(record(number, odd) for number in range(1, 5)))[0] == [1, 2, 3, 4]
    assert read(record(1), record(2), record(3, odd), record(4, odd), record(5, odd))[0] == [1, 2, 3, 4, 5]
    assert read(record(1), record(2), record(3, odd), *(record(number) for number in range(4, 8))) == (
        [1, 2, 4, 5, 6, 7],
        DecoderHealth(bad=1, bad_bytes=36, lost=1),
    )


@pytest.mark.parametrize("place", range(6))
def test_N3_a_count_at_the_end_of_its_range_is_marked(place: int) -> None:
    for rail in (-(1 << 31), (1 << 31) - 1):
        counts = list(COUNTS)
        counts[place] = rail
        records = rdt.RecordScanner(DecoderHealth(), RESERVED)
        heads, values = records.receive(record(1) + rdt.encode_record(counts, 2, 14, 3) + record(3))
        assert [status for _, status in heads] == [0, 3 | rdt.AT_RAIL, 0]
        assert values[1, place] == rail


def test_L2_lost_or_added_bytes_cost_one_record_and_the_next_at_most() -> None:
    rng = random.Random(4)
    for _ in range(2000):
        hit = bytearray(record(103))
        at = rng.randrange(36)
        kind = rng.randrange(3)
        if kind == 0:
            del hit[at : at + rng.randrange(1, 30)]
        elif kind == 1:
            hit[at:at] = rng.randbytes(rng.randrange(1, 30))
        else:
            hit[at] ^= 1 << rng.randrange(8)
        numbers, health = read(record(101) + record(102) + bytes(hit) + b"".join(record(n) for n in range(104, 109)))
        assert numbers[:2] == [101, 102]
        assert numbers[-4:] == [105, 106, 107, 108], (hit.hex(), numbers)
        assert health.restarts == 0
        assert health.lost <= 2


def test_L2_one_bit_of_a_number_costs_that_record_alone() -> None:
    for bit in range(32):
        flipped = rdt.encode_record(COUNTS, 1000 ^ 1 << bit, 7000)
        numbers, health = read(*(record(n) for n in range(995, 1000)), flipped, *(record(n) for n in range(1001, 1006)))
        assert numbers == [995, 996, 997, 998, 999, 1001, 1002, 1003, 1004, 1005]
        assert health.lost == 1
        assert health.bad + health.duplicates == 1


def test_L3_noise_yields_no_record_before_or_after_good_ones() -> None:
    rng = random.Random(6)
    numbers, health = read(rng.randbytes(100_000))
    assert numbers == []
    assert health.bad_bytes > 99_500
    numbers, _ = read(record(1), rng.randbytes(100_000), *(record(number) for number in range(2, 6)))
    assert numbers == [1, 2, 3, 4, 5]


def test_L3_after_garbage_at_the_very_start_four_records_confirm_each_other() -> None:
    rng = random.Random(7)
    for size in range(1, 80):
        stream = [record(number) for number in range(100, 104)]
        assert read(b"\xff" + rng.randbytes(size), *stream[:3])[0] == []
        assert read(b"\xff" + rng.randbytes(size), *stream)[0] == [100, 101, 102, 103]


def test_L3_the_counts_of_a_resting_sensor_are_not_mistaken_for_records() -> None:
    rng = np.random.default_rng(9)
    stream = b"".join(
        rdt.encode_record(rng.integers(-2, 3, size=6).tolist(), number, number) for number in range(10, 400)
    )
    for start in range(1, 36):
        health = DecoderHealth()
        heads, _ = rdt.RecordScanner(health, RESERVED).receive(b"\xff\xff" + stream[start:])
        clock = [ticks for ticks, _ in heads]
        assert clock == list(range(11, 400))


def test_L3_less_than_four_records_are_kept() -> None:
    records = rdt.RecordScanner(DecoderHealth(), RESERVED)
    rng = random.Random(8)
    for _ in range(100):
        records.receive(rng.randbytes(500))
        assert len(records._frames._tail) < 4 * rdt.RECORD_LENGTH


PIECES = st.lists(st.one_of(st.integers(1, 60).map(record), st.binary(max_size=80)), max_size=12)


@given(PIECES, st.lists(st.integers(1, 50), min_size=1, max_size=20))
def test_L1_any_split_of_any_stream_reads_the_same(parts: list[bytes], sizes: list[int]) -> None:
    stream = b"".join(parts)
    pieces, at = [], 0
    while at < len(stream):
        size = sizes[len(pieces) % len(sizes)]
        pieces.append(stream[at : at + size])
        at += size
    assert read(*pieces) == read(stream)


FAULTS = ("reserved", "status", "rail", "flip", "cut", "insert", "forget", "wrap")
EVENTS = st.tuples(
    st.sampled_from(("send", "send", "send", "gap", "repeat", "start", "other_start", "reset_clock", "rest", *FAULTS)),
    st.integers(1, 40),
    st.integers(0, 1 << 12),
)
"""What happens to the next datagram, and by how much: records in it, or records that are missed, or a place."""


def datagrams(events: list[tuple[str, int, int]]) -> list[bytes | None]:
    """Return the datagrams of a sensor on a line with faults; None: the stream is opened again."""
    number, clock, step, status, sent = 1, 7, 7, 0, []
    for what, count, place in [*events, *[("send", 2, 0)] * 3]:
        if what == "forget":
            sent.append(None)
            continue
        clock += count * step if what == "gap" else 0
        number += count if what == "gap" else 0
        if what in ("start", "other_start"):
            number, clock = 1 if what == "start" else 1 + count, clock + place
        elif what == "reset_clock":
            clock = place
        elif what == "wrap":
            number, clock = number if place % 2 else SPAN - 3, SPAN - 10
        elif what == "rest":
            step = 7 if place % 2 else 0
        elif what == "reserved":
            status ^= 1 << 16 + place % 16
        elif what == "status":
            status ^= 1 << place % 16
        datagram = bytearray()
        for k in range(1 + count % 5):
            counts = [*COUNTS]
            if what == "rail" and k == place % 3:
                counts[place % 6] = (-(1 << 31), (1 << 31) - 1)[place % 2]
            datagram += rdt.encode_record(counts, number, clock, status)
            number, clock = number + 1, clock + step
        at = place % len(datagram)
        if what == "flip":
            datagram[at] ^= 1 << count % 8
        elif what == "cut":
            del datagram[at : at + count]
        elif what == "insert":
            datagram[at:at] = datagram[:count]
        sent += [bytes(datagram)] * (2 if what == "repeat" else 1)
    return sent


def results(sent: list[bytes | None], size: int) -> tuple[list[list[object]], DecoderHealth]:
    """Return heads and counts after each datagram, received in pieces of ``size`` bytes, and the health."""
    health = DecoderHealth()
    records = rdt.RecordScanner(health, RESERVED)
    found: list[list[object]] = []
    for datagram in sent:
        if datagram is None:
            records.forget()
            continue
        found.append([])
        for at in range(0, len(datagram), size):
            heads, counts = records.receive(datagram[at : at + size])
            found[-1] += zip(heads, counts.tolist(), strict=True)
            assert records._in_sync or records._frames.has_partial, "out of sync, whole records are not read directly"
    return found, health


@given(st.lists(EVENTS, max_size=12), st.sampled_from((1, 11, 36)))
def test_L1_a_whole_datagram_is_read_as_its_pieces_are(events: list[tuple[str, int, int]], size: int) -> None:
    sent = datagrams(events)
    assert results(sent, 2000) == results(sent, size)


def test_D3_the_clock_of_a_late_record_moves_none_after_it() -> None:
    """Of two overtaken datagrams, the second is late by its numbers alone."""
    first = [rdt.encode_record(COUNTS, SPAN - 3 + step, SPAN - 21 + 7 * step) for step in range(4)]
    second = [record(n, ticks=7 * n + 11) for n in (37, 38)]
    stream = [[record(37), record(38)], first, second]
    stream += [[record(n, ticks=7 * n + 11) for n in (n, n + 1)] for n in (39, 41, 43)]
    whole, health = results([b"".join(records) for records in stream], 2000)
    assert (whole, health) == results([b"".join(records) for records in stream], 1)
    assert [head[0] for found in whole for head, _ in found] == [259, 266, *(7 * n + 11 for n in range(39, 45))]
    assert health == DecoderHealth(duplicates=6)


def test_counts_own_their_memory() -> None:
    records = rdt.RecordScanner(DecoderHealth(), RESERVED)
    first, second = (records.receive(record(number))[1] for number in (1, 2))
    first[:] = 0
    assert second[0, 1] == 2000
    assert second.dtype == np.float64
