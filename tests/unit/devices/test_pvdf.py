"""Frames of the PVDF pad: the documented one, complete and incomplete scans, and every step of the scan number."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from project import DOCS

from slipd.devices import pvdf
from slipd.devices.shared import checksums
from slipd.devices.shared.device_interface import DecoderHealth

FRAME = 46
DOCUMENT = DOCS / "devices.md"


def counts(number: int, rows: int = 8, cols: int = 16) -> np.ndarray:
    return np.random.default_rng(number).integers(-(1 << 15), 1 << 15, size=(rows, cols))


def rows_of(number: int, time_us: int | None = None) -> list[bytes]:
    """Return the frames of scan ``number``; its readings depend on the number."""
    time_us = 5000 * number if time_us is None else time_us
    scan = pvdf.encode_scan(counts(number), number, time_us, 39.06)
    return [scan[at : at + FRAME] for at in range(0, len(scan), FRAME)]


def decode(*frames: bytes) -> tuple[list[int], pvdf.Decoder]:
    """Return the numbers of the returned scans, after checking their values, and the decoder."""
    decoder = pvdf.Decoder()
    numbers = []
    for sample in decoder.receive(b"".join(frames), 0):
        assert sample.device_time_ns is not None
        number = sample.device_time_ns // 5_000_000
        np.testing.assert_array_equal(sample.values, counts(number).ravel())
        numbers.append(number)
    return numbers, decoder


def results(decoder: pvdf.Decoder, reads: list[bytes]) -> tuple[list[tuple[int | None, int, bytes]], str]:
    """Return the samples and health of a decoder for a list of reads."""
    samples = [sample for read in reads for sample in decoder.receive(read, 0)]
    return [(one.device_time_ns, one.dwell_ns, one.values.tobytes()) for one in samples], repr(decoder.health)


@given(first=st.sampled_from((1, 2, 9)), at=st.integers(0, 2 * 8 * FRAME - 1), flip=st.integers(0, 255))
def test_whole_scans_in_one_read_equal_their_frames_one_by_one(first: int, at: int, flip: int) -> None:
    """Complete and in order, damaged at any place, or with jumps; the data after it are read the same way."""
    spoilt = bytearray(b"".join(rows_of(first) + rows_of(first + 1)))
    spoilt[at] ^= flip
    reads = [b"".join(rows_of(0)), bytes(spoilt), b"".join(rows_of(first + 2))]
    frames = [read[k : k + FRAME] for read in reads for k in range(0, len(read), FRAME)]
    assert results(pvdf.Decoder(), reads) == results(pvdf.Decoder(), frames)


def test_whole_scans_are_read_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    decoder = pvdf.Decoder()
    decoder.receive(b"".join(rows_of(258)), 0)
    monkeypatch.setattr(decoder, "_decode_rows", None)
    samples = decoder.receive(b"".join(rows_of(259) + rows_of(260)), 0)
    assert [sample.values.tolist() for sample in samples] == [counts(n).ravel().tolist() for n in (259, 260)]


def test_a_scan_comes_out_in_scan_order_with_its_times() -> None:
    decoder = pvdf.Decoder(rows=2, cols=3)
    stream = pvdf.encode_scan(np.array([[1, -2, 3], [-32768, 32767, 0]]), 9, 1000, 39.06)
    assert len(stream) == 2 * (14 + 6)
    (sample,) = decoder.receive(stream, 77)
    assert sample.values.tolist() == [1, -2, 3, -32768, 32767, 0]
    assert sample.values.dtype == np.float64
    assert (sample.t_ns, sample.device_time_ns, sample.dwell_ns) == (77, 1_000_000, 39_060)
    assert (decoder.health.good, decoder.health.bad, decoder.health.lost) == (1, 0, 0)


def test_the_documented_frame_is_encoded() -> None:
    (block,) = re.findall(r"<!-- pvdf frame -->\n+```\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)
    frame = bytes.fromhex("".join(line.split("|")[0] for line in block.splitlines()))
    readings = np.zeros((8, 16), dtype=np.int64)
    readings[3] = np.arange(-8, 8) * 100
    scan = pvdf.encode_scan(readings, 258, 1_000_000, 39.06)
    assert scan[3 * FRAME : 4 * FRAME] == frame


def test_each_row_carries_the_time_of_its_first_taxel() -> None:
    times = [int.from_bytes(row[6:10], "little") for row in rows_of(0, (1 << 32) - 1000)]
    assert times == [((1 << 32) - 1000 + round(row * 16 * 39.06)) % (1 << 32) for row in range(8)]


@pytest.mark.parametrize("missing", range(8))
def test_a_scan_without_one_of_its_rows_is_dropped_whole_and_counted_once(missing: int) -> None:
    middle = rows_of(1)
    del middle[missing]
    numbers, decoder = decode(*rows_of(0), *middle, *rows_of(2))
    assert numbers == [0, 2]
    assert decoder.health.lost == 1


def test_a_pad_that_never_sends_one_row_loses_every_scan() -> None:
    numbers, decoder = decode(*(frame for number in range(5) for frame in rows_of(number)[:-1]))
    assert numbers == []
    assert decoder.health.lost == 4  # the fifth may still continue


def test_joining_in_the_middle_of_a_scan_loses_nothing() -> None:
    numbers, decoder = decode(*rows_of(0)[3:], *rows_of(1))
    assert numbers == [1]
    assert decoder.health.lost == 0


@pytest.mark.parametrize(
    ("first", "second", "lost"), [(3, 4, 0), (3, 8, 4), (65_534, 65_537, 2), (65_535, 65_536, 0), (3, 32_770, 32_766)]
)
def test_the_scan_counter_shows_how_many_scans_are_missing(first: int, second: int, lost: int) -> None:
    numbers, decoder = decode(*rows_of(first), *rows_of(second))
    assert numbers == [first, second]
    assert decoder.health.lost == lost


def test_a_counter_that_jumps_back_is_a_restart_and_loses_only_the_interrupted_scan() -> None:
    numbers, decoder = decode(*rows_of(500), *rows_of(501)[:4], *rows_of(0), *rows_of(1))
    assert numbers == [500, 0, 1]
    assert (decoder.health.lost, decoder.health.restarts) == (1, 1)


def test_a_restart_under_the_same_scan_number_is_not_mixed_with_what_came_before() -> None:
    before = rows_of(7, time_us=123)[:4]
    numbers, decoder = decode(*before, *rows_of(7))
    assert numbers == [7]
    assert (decoder.health.lost, decoder.health.restarts) == (1, 1)


def test_a_repeated_first_row_is_skipped_and_another_repeated_row_drops_the_scan() -> None:
    twice = rows_of(0)
    numbers, decoder = decode(twice[0], *twice)
    assert (numbers, decoder.health.duplicates, decoder.health.lost) == ([0], 1, 0)
    numbers, decoder = decode(*twice, *twice, *rows_of(1))
    assert (numbers, decoder.health) == ([0, 1], DecoderHealth(good=2, duplicates=1)), "a whole scan again"
    numbers, decoder = decode(*twice[:4], twice[3], *twice[4:], *rows_of(1))
    assert (numbers, decoder.health.lost) == ([1], 1)


def test_rows_in_backward_order_give_no_scan() -> None:
    numbers, decoder = decode(*reversed(rows_of(0)), *rows_of(1))
    assert numbers == [1]
    assert decoder.health.lost <= 1


def test_a_row_beyond_the_pad_is_bad_and_drops_no_scan() -> None:
    stream = pvdf.encode_scan(counts(0, 9), 3, 0, 39.06)
    decoder = pvdf.Decoder(rows=8)
    assert len(decoder.receive(stream, 0)) == 1
    assert decoder.health.bad == 1


def test_another_format_version_is_refused() -> None:
    frames = [bytearray(frame) for frame in rows_of(0)]
    for frame in frames:
        frame[2] = 2
        frame[-2:] = checksums.x25(bytes(frame[2:-2])).to_bytes(2, "little")
    decoder = pvdf.Decoder()
    assert decoder.receive(b"".join(map(bytes, frames)), 0) == []
    assert decoder.health.bad == 8


SCANS = [rows_of(number) for number in range(5)]


@given(st.sets(st.integers(0, 5 * 8 - 1), max_size=20))
def test_whatever_rows_are_lost_each_scan_is_whole_or_counted(gone: set[int]) -> None:
    numbers, decoder = decode(*(SCANS[at // 8][at % 8] for at in range(40) if at not in gone))
    whole = [number for number in range(5) if not gone & set(range(8 * number, 8 * number + 8))]
    assert numbers == whole
    seen = [at for at in range(40) if at not in gone]
    first, last = seen[0] // 8, seen[-1] // 8
    joined_midway = seen[0] % 8 != 0
    last_open = (
        last not in whole and gone.isdisjoint(range(8 * last, seen[-1])) and not (joined_midway and first == last)
    )
    assert decoder.health.lost == last - first + 1 - len(whole) - joined_midway - last_open


@pytest.mark.parametrize(
    "bad",
    [np.zeros((8, 16)), np.zeros(128, dtype=int), np.full((8, 16), 32768), np.zeros((300, 2), dtype=int)],
)
def test_counts_that_cannot_be_sent_are_refused(bad: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"counts must|dwell_us must"):
        pvdf.encode_scan(bad, 0, 0, 39.06)


@pytest.mark.parametrize("dwell_us", [-1, 655.36])
def test_a_dwell_that_cannot_be_sent_is_refused(dwell_us: float) -> None:
    with pytest.raises(ValueError, match="dwell"):
        pvdf.encode_scan(counts(0), 0, 0, dwell_us)


@pytest.mark.parametrize(("rows", "cols"), [(1, 1), (256, 256)])
def test_the_smallest_and_the_largest_pad_are_read(rows: int, cols: int) -> None:
    (sample,) = pvdf.Decoder(rows, cols).receive(pvdf.encode_scan(counts(0, rows, cols), 0, 0, 0.01), 0)
    assert sample.values.tolist() == counts(0, rows, cols).ravel().tolist()
