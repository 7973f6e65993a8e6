"""Images and answers of the DSACON32m: worked packets, and incomplete, damaged, mixed and impossible images."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.devices import dsacon32
from slipd.devices.shared import weiss_packets as weiss
from slipd.devices.shared import weiss_tactile
from slipd.devices.shared.weiss_packets import SEED_AFTER_PREAMBLE
from slipd.tools.sim import emulated_dsacon32 as sim

SplitCheck = Callable[[Callable[[], Any], bytes], list[tuple[Any, ...]]]

CELLS = [0, 0, 0, 0, 100, 250, 0, 0, 0, 0, 7, 0]
PLAIN = bytes.fromhex(
    "AA AA AA 00 1D 00 E8 03 00 00 00 00 00 00 00 00 00 00 00 64 00 FA 00 00 00 00 00 00 00 00 00 07 00 00 00 FB 76"
)
RLE = bytes.fromhex("AA AA AA 00 11 00 09 04 00 00 01 00 40 64 10 FA 10 00 40 07 10 00 10 67 91")
"""Both computed from the drivers' field tables; none was taken from a controller."""

FORMS = [[4, 2], [2, 2]]


def frames(count: int, *, rle: bool = False, cells: int = 12) -> list[bytes]:
    rng = np.random.default_rng(3)
    images = rng.integers(0, 4096, (count, cells)) * (rng.random((count, cells)) < 0.5)
    return [dsacon32.encode_frame(image, 33 * number, rle=rle) for number, image in enumerate(images)]


def decode(*stream: bytes, matrices: list[list[float]] | None = None) -> tuple[list[int], dsacon32.Decoder]:
    """Return the device time of each sample, ms, and the decoder."""
    decoder = dsacon32.Decoder(matrices)
    samples = decoder.receive(b"".join(stream), 0)
    return [sample.device_time_ns // 1_000_000 for sample in samples if sample.device_time_ns is not None], decoder


def payload_frame(payload: str) -> bytes:
    return weiss.encode(0, bytes.fromhex(payload), SEED_AFTER_PREAMBLE)


@pytest.mark.parametrize(("frame", "time_ms"), [(PLAIN, 1000), (RLE, 1033)])
def test_a_worked_image_is_written(frame: bytes, time_ms: int) -> None:
    assert dsacon32.encode_frame(CELLS, time_ms, rle=frame is RLE) == frame


@pytest.mark.parametrize("rle", [False, True])
def test_a_matrix_with_a_cell_at_full_scale_is_saturated_and_the_other_is_not(rle: bool) -> None:
    samples = dsacon32.Decoder(FORMS).receive(dsacon32.encode_frame([4094] * 8 + [0, 0, 4095, 0], 0, rle=rle), 0)
    assert [sample.status for sample in samples] == [(), ("saturated",)]


@given(st.lists(st.integers(0, 4095) | st.just(0), min_size=1, max_size=300))
def test_run_lengths_give_back_what_they_encode(cells: list[int]) -> None:
    frame = dsacon32.encode_frame(cells, 0, rle=True)
    (sample,) = dsacon32.Decoder().receive(frame, 0)
    assert sample.values.tolist() == cells


def test_a_run_is_at_most_fifteen_cells_long() -> None:
    assert dsacon32.encode_frame([5] * 32, 0, rle=True)[11:-2] == bytes.fromhex("05 F0 05 F0 05 20")


def test_a_run_of_zero_cells_adds_nothing() -> None:
    (sample,) = dsacon32.Decoder().receive(payload_frame("00 00 00 00 01  07 00 05 10 00 00"), 0)
    assert sample.values.tolist() == [5]


def test_L3_the_buffer_is_bounded_by_the_longest_image() -> None:
    decoder = dsacon32.Decoder()
    longest = dsacon32.encode_frame([9] * weiss_tactile.MAX_CELLS, 0)
    assert len(decoder.receive(longest, 0)) == 1
    for size in range(0, 1 << 16, 97):
        decoder.receive(weiss.PREAMBLE + b"\0" + size.to_bytes(2, "little") + bytes(5000), 0)
        assert len(decoder._scanner._tail) < len(longest)


@pytest.mark.parametrize("frame", [PLAIN, RLE])
def test_L3_a_length_beyond_the_known_matrices_is_rejected_at_the_flags(frame: bytes) -> None:
    decoder = dsacon32.Decoder(FORMS)
    decoder.receive(frame[:4] + b"\x1f" + frame[5:11], 0)
    assert decoder.health.bad_bytes == 11


def test_L3_a_wrong_length_of_long_runs_is_found_when_the_next_image_arrives() -> None:
    decoder = dsacon32.Decoder([[20, 30]])
    one, two, three = (dsacon32.encode_frame([5] * 600, number, rle=True) for number in range(3))
    wrong = one[:4] + (2 * 590 + 5).to_bytes(2, "little") + one[6:]
    assert [sample.device_time_ns for sample in decoder.receive(wrong + two + three, 0)] == [1_000_000, 2_000_000]


@pytest.mark.parametrize("rle", [False, True])
def test_L3_a_wrong_length_is_found_when_the_next_image_arrives(rle: bool) -> None:
    one, two, three = frames(3, rle=rle, cells=600)
    wrong = one[:4] + (4000 + 5).to_bytes(2, "little") + one[6:]
    seen, _ = decode(wrong, two, three, matrices=[[20, 30]] if rle else None)
    assert seen == [33, 66]


@pytest.mark.parametrize("size", [101, 1001, 4001])
def test_L3_a_wrong_length_is_found_once_a_whole_packet_follows_it(size: int) -> None:
    one, two, three = frames(3, rle=True)
    lie = one[:4] + size.to_bytes(2, "little") + one[6:]
    assert decode(lie, two)[0] == [33]
    assert decode(lie, weiss.PREAMBLE[:2], two, three)[0] == [33, 66]
    assert decode(sim.encode_matrix(6, 14)[:10], frames(1, rle=True, cells=4)[0])[0] == [0]


def test_L1_every_split_reads_the_same_after_a_wrong_length(same_for_every_split: SplitCheck) -> None:
    one, *rest = frames(4, rle=True)
    lie = one[:4] + (1001).to_bytes(2, "little") + one[6:]
    assert len(same_for_every_split(dsacon32.Decoder, rest[0] + lie + b"".join(rest[1:]))) == 3


def test_an_image_that_contains_what_only_looks_like_a_packet_is_accepted() -> None:
    cells = [0xAAA] * 10 + [0xAA] * 3 + [0] * 3
    assert weiss.PREAMBLE in dsacon32.encode_frame(cells, 0, rle=True)[3:]
    assert decode(dsacon32.encode_frame(cells, 33, rle=True))[0] == [33]
    unknown = weiss.encode(9, b"\0\x10\0", SEED_AFTER_PREAMBLE)
    assert decode(payload_frame("21 00 00 00 01" + unknown.hex() + "00 00 00" * (len(unknown) % 2)))[0] == [33]


@pytest.mark.parametrize("rle", [False, True])
@pytest.mark.parametrize("cells", [1, 11, 13, 24])
def test_T2_an_image_of_another_size_is_dropped_whole(cells: int, rle: bool) -> None:
    seen, decoder = decode(frames(1)[0], *frames(1, rle=rle, cells=cells), frames(3)[2], matrices=FORMS)
    assert seen == [0, 0, 66, 66]
    assert decoder.health.bad > 0


def test_T2_two_images_mixed_are_dropped_whole() -> None:
    rng = random.Random(7)
    one, two, three = frames(3, cells=84)
    passed = 0
    for cut in range(1, len(one)):
        mixed = one[:cut] + two[cut:]
        seen, _ = decode(mixed, three)
        assert seen[-1] == 66
        passed += len(seen) > 1 and mixed not in (one, two)
        torn = one[: rng.randrange(1, len(one))] + two[cut:]
        assert decode(torn, three)[0][-1] == 66
    assert passed == 0


def test_a_value_beyond_12_bits_gives_no_image() -> None:
    bad = payload_frame("00 00 00 00 00 FF 0F 00 10")
    seen, decoder = decode(bad, PLAIN)
    assert seen == [1000]
    assert decoder.health.bad_bytes == len(bad)


def test_an_image_without_cells_or_with_half_a_cell_is_rejected() -> None:
    for empty in ("00 00 00 00 00", "00 00 00 00", "00 00 00 00 01 05 00", "00 00 00 00 00 05 00 07"):
        assert decode(payload_frame(empty), PLAIN)[0] == [1000]


def test_more_cells_than_any_controller_has_are_rejected() -> None:
    too_many = [9] * (weiss_tactile.MAX_CELLS + 1)
    for rle in (False, True):
        assert decode(dsacon32.encode_frame(too_many, 0, rle=rle), PLAIN)[0] == [1000]


def test_D1_boot_text_is_no_damage() -> None:
    seen, decoder = decode(b"\x1b[5n" * 3, PLAIN, b"\x1b[5n")
    assert seen == [1000]
    assert (decoder.health.bad, decoder.health.bad_bytes) == (0, 0)


def test_the_device_time_is_returned_as_sent_and_wraps() -> None:
    stream = [dsacon32.encode_frame([1], (1 << 32) + step) for step in (-1, 0, 1)]
    assert decode(*stream)[0] == [(1 << 32) - 1, 0, 1]


@pytest.mark.parametrize(
    ("made", "sent"),
    [
        (dsacon32.encode_query(dsacon32.CONTROLLER), "01 00 00"),
        (dsacon32.encode_query(dsacon32.SENSOR), "02 00 00"),
        (dsacon32.encode_matrix_query(0), "0B 01 00 00 CB FB"),
        (dsacon32.acquire(30, rle=True), "03 03 00 81 1E 00 2C 76"),
        (dsacon32.acquire(30, rle=False), "03 03 00 80 1E 00 8E 1C"),
        (dsacon32.acquire(0, rle=True), "03 03 00 01 00 00 2F 6A"),
        (dsacon32.acquire(0, rle=False), "03 03 00 00 00 00 8D 00"),
        (sim.encode_error(dsacon32.ACQUIRE), "03 02 00 00 00 4B B9"),
        (
            sim.encode_controller(1234),
            "01 12 00 00 00 D2 04 00 00 20 20 01 80 10 01 00 00 00 00 00 00 75 46",
        ),
        (sim.encode_sensor(6, 5678), "02 0C 00 00 00 06 00 20 01 01 2E 16 00 00 00 6E 22"),
        (
            sim.encode_matrix(6, 14),
            "0B 34 00 00 00 9A 99 59 40 9A 99 59 40 06 00 0E 00 01 02 03 04 05 06 00 00 10"
            + " 00" * 24
            + " 00 F0 7F 45 00 65 CD",
        ),
    ],
)
def test_worked_requests_and_answers_are_encoded(made: bytes, sent: str) -> None:
    assert made == bytes.fromhex("AA AA AA" + sent)


@pytest.mark.parametrize(
    ("answers", "problem"),
    [
        (["02 0C 00  00 00 FF FF 20 01 01 2E 16 00 00 00"], "a controller must have 1 to 16 matrices, got 65535"),
        (
            [
                "02 0C 00  00 00 06 00 20 01 01 2E 16 00 00 00",
                "0B 34 00  00 00 9A 99 59 40 9A 99 59 40 FF FF FE FF" + "00" * 33 + "00 F0 7F 45 00",
            ],
            "the matrices must have at most 2048 cells, got 4294770690",
        ),
    ],
)
def test_numbers_and_sides_of_matrices_are_unsigned(answers: list[str], problem: str) -> None:
    """Fields: ``sSensorInfo`` and ``sMatrixInfo`` in ipab-slmc/SDHLibrary-CPP at 4ddc1d0, ``sdh/dsa.h``."""
    session = dsacon32.Session()
    session.start(0)
    session.receive(sim.encode_controller(1), 1)
    for answer in map(bytes.fromhex, answers):
        session.on_time(1)
        session.receive(weiss.PREAMBLE + answer + weiss.checksum(answer).to_bytes(2, "little"), 1)
    assert session.state == problem


def test_a_matrix_may_have_odd_sides_or_a_single_cell() -> None:
    decoder = dsacon32.Decoder([[6, 14], [6, 13], [1, 1]])
    samples = decoder.receive(dsacon32.encode_frame(range(84 + 78 + 1), 0), 0)
    assert [(sample.values[0], len(sample.values)) for sample in samples] == [(0, 84), (84, 78), (162, 1)]


@pytest.mark.parametrize(("code", "word"), [(11, "checksum error"), (12, "not enough parameters"), (27, "range error")])
def test_errors_are_numbered_as_this_controller_does(code: int, word: str) -> None:
    assert weiss.status_word(code, dsacon32.ERROR_WORDS) == word


def test_an_error_beyond_the_last_has_no_word() -> None:
    assert weiss.status_word(28, dsacon32.ERROR_WORDS) == "status 28"
