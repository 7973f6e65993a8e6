"""Frames of the PVDF pad: the documented one, complete and incomplete scans, and every step of the scan number."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from readings import Case, documented, fields

from slipd.devices import pvdf
from slipd.devices.pvdf import encode_scan
from slipd.devices.shared import checksums

FRAME = 46
PERIOD_US = 5000
LAST = 65_535


def counts(number: int, rows: int = 8, cols: int = 16) -> np.ndarray:
    return np.random.default_rng(number).integers(-(1 << 15), 1 << 15, size=(rows, cols))


def rows_of(number: int) -> list[bytes]:
    """Return the frames of scan ``number``; its readings depend on the number."""
    scan = encode_scan(counts(number), number, PERIOD_US * number, 39.06)
    return [scan[at : at + FRAME] for at in range(0, len(scan), FRAME)]


def stream(*parts: int | list[bytes]) -> bytes:
    """Return scans by their numbers, and rows as they are."""
    return b"".join(row for part in parts for row in (rows_of(part) if isinstance(part, int) else part))


def scans(*numbers: int) -> list[dict[str, Any]]:
    return [{"values": counts(n).ravel(), "device_time_ns": 1000 * PERIOD_US * n % (1000 << 32)} for n in numbers]


def of_version(number: int) -> list[bytes]:
    bodies = [frame[:2] + bytes((number,)) + frame[3:-2] for frame in rows_of(0)]
    return [body + checksums.x25(body[2:]).to_bytes(2, "little") for body in bodies]


ZERO = rows_of(0)
CASES = {
    "a scan comes out in scan order with its times": Case(
        encode_scan(np.array([[1, -2, 3], [-32768, 32767, 0]]), 9, 1000, 39.06),
        [{"values": [1, -2, 3, -32768, 32767, 0], "device_time_ns": 1_000_000, "dwell_ns": 39_060}],
        options={"rows": 2, "cols": 3},
    ),
    **{
        f"a pad of {rows} x {cols} is read": Case(
            encode_scan(counts(0, rows, cols), 0, 0, 0.01),
            fields("values", [counts(0, rows, cols).ravel()]),
            options={"rows": rows, "cols": cols},
        )
        for rows, cols in ((1, 1), (256, 3), (2, 256))
    },
    **{
        f"a scan without row {missing} is dropped whole and counted once": Case(
            stream(0, rows_of(1)[:missing], rows_of(1)[missing + 1 :], 2), scans(0, 2), {"lost": 1}
        )
        for missing in range(8)
    },
    "a pad that never sends one row loses every scan, but the last may still continue": Case(
        stream(*(rows_of(number)[:-1] for number in range(5))), [], {"lost": 4}
    ),
    "joining in the middle of a scan loses nothing": Case(stream(rows_of(0)[3:], 1), scans(1)),
    **{
        f"{lost} scans are missing from {first} to {second}": Case(
            stream(first, second), scans(first, second), {"lost": lost}
        )
        for first, second, lost in (
            (3, 4, 0),
            (3, 8, 4),
            (LAST - 1, LAST + 2, 2),
            (LAST, LAST + 1, 0),
            (3, 32_770, 32_766),
        )
    },
    "a counter that jumps back is a restart and loses only the interrupted scan": Case(
        stream(500, rows_of(501)[:4], 0, 1), scans(500, 0, 1), {"lost": 1, "restarts": 1}
    ),
    "a restart under the same scan number is not mixed with what came before": Case(
        encode_scan(counts(7), 7, 123, 39.06)[: 4 * FRAME] + stream(7),
        scans(7),
        {"lost": 1, "restarts": 1},
    ),
    "a repeated first row is skipped": Case(stream(ZERO[:1], 0), scans(0), {"duplicates": 1}),
    "a whole scan again is skipped": Case(stream(0, 0, 1), scans(0, 1), {"duplicates": 1}),
    "another repeated row drops the scan": Case(stream(ZERO[:4], ZERO[3:], 1), scans(1), {"lost": 1}),
    "rows in backward order give no scan": Case(stream(rows_of(7)[::-1], 8), scans(8), {"lost": 1, "restarts": 1}),
    "a row beyond the pad is bad and drops no scan": Case(
        encode_scan(counts(0, 9), 3, 0, 39.06), fields("values", [counts(0, 9)[:8].ravel()]), {"bad": 1}
    ),
    "another format version is refused": Case(
        stream(of_version(2), of_version(1)), scans(0), {"bad": 8, "bad_bytes": 8 * FRAME}
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_D2_D3_T2_a_stream_gives_these_scans_and_counts(name: str) -> None:
    CASES[name].check(pvdf.Decoder)


def results(reads: list[bytes]) -> tuple[list[tuple[int | None, int, bytes]], str]:
    """Return samples and health of a decoder for a list of reads."""
    decoder = pvdf.Decoder()
    samples = [sample for read in reads for sample in decoder.receive(read, 0)]
    return [(one.device_time_ns, one.dwell_ns, one.values.tobytes()) for one in samples], repr(decoder.health)


@given(first=st.sampled_from((1, 2, 9)), at=st.integers(0, 2 * 8 * FRAME - 1), flip=st.integers(0, 255))
def test_whole_scans_in_one_read_equal_their_frames_one_by_one(first: int, at: int, flip: int) -> None:
    """Complete and in order, damaged at any place, or with jumps; the data after it are read the same way."""
    spoilt = bytearray(stream(first, first + 1))
    spoilt[at] ^= flip
    reads = [stream(0), bytes(spoilt), stream(first + 2)]
    assert results(reads) == results([read[k : k + FRAME] for read in reads for k in range(0, len(read), FRAME)])


def test_whole_scans_are_read_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    decoder = pvdf.Decoder()
    decoder.receive(stream(258), 0)
    monkeypatch.setattr(decoder, "_decode_rows", None)
    slower = b"".join(encode_scan(counts(n), n, PERIOD_US * n, 40.0) for n in (259, 260))
    found = [(sample.values.tolist(), sample.dwell_ns) for sample in decoder.receive(slower, 0)]
    assert found == [(counts(n).ravel().tolist(), 40_000) for n in (259, 260)]


def test_the_documented_frame_is_encoded() -> None:
    readings = np.zeros((8, 16), dtype=np.int64)
    readings[3] = np.arange(-8, 8) * 100
    scan = encode_scan(readings, 258, 1_000_000, 39.06)
    assert scan[3 * FRAME : 4 * FRAME] == documented("pvdf")


def test_each_row_carries_the_time_of_its_first_taxel() -> None:
    scan = encode_scan(counts(0), 0, (1 << 32) - 1000, 39.06)
    times = [int.from_bytes(scan[at + 6 : at + 10], "little") for at in range(0, len(scan), FRAME)]
    assert times == [((1 << 32) - 1000 + round(row * 16 * 39.06)) % (1 << 32) for row in range(8)]


@pytest.mark.parametrize(
    ("bad", "dwell_us", "words"),
    [
        (np.zeros((8, 16)), 1.0, "counts must be integers"),
        (np.zeros(128, dtype=int), 1.0, "counts must be integers"),
        (np.full((8, 16), 32_768), 1.0, "must fit an int16"),
        (np.full((8, 16), -32_769), 1.0, "must fit an int16"),
        (np.zeros((257, 2), dtype=int), 1.0, "at most 256 rows"),
        (counts(0), -1.0, "dwell_us must be"),
        (counts(0), 655.36, "dwell_us must be"),
    ],
)
def test_a_scan_that_cannot_be_sent_is_refused(bad: np.ndarray, dwell_us: float, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        encode_scan(bad, 0, 0, dwell_us)
