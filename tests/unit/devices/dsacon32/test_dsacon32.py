"""Images and answers of the DSACON32m: runs of cells, wrong lengths, and images that do not fit the matrices."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from readings import Case, dropped, fields

from slipd.devices import dsacon32
from slipd.devices.shared import weiss_packets as weiss
from slipd.devices.shared.weiss_tactile import MAX_CELLS
from slipd.tools.sim.emulated_weiss import encode_frame

PLAIN = bytes.fromhex(
    "AA AA AA 00 1D 00 E8 03 00 00 00 00 00 00 00 00 00 00 00 64 00 FA 00 00 00 00 00 00 00 00 00 07 00 00 00 FB 76"
)
RLE = bytes.fromhex("AA AA AA 00 11 00 09 04 00 00 01 00 40 64 10 FA 10 00 40 07 10 00 10 67 91")
"""Both computed from the drivers' field tables; none was taken from a controller."""

FORMS = {"matrices": [[4, 2], [2, 2]]}
WIDE = {"matrices": [[20, 30]]}


def image(time_ms: int, cells: int = 12, *, rle: bool = True) -> bytes:
    return encode_frame([(time_ms + cell // 5) % 4096 for cell in range(cells)], time_ms, rle=rle)


def payload(text: str) -> bytes:
    return weiss.encode(0, bytes.fromhex(text), weiss.SEED_AFTER_PREAMBLE)


def at_ms(*times_ms: int) -> list[dict[str, Any]]:
    return fields("device_time_ns", [time_ms * 1_000_000 for time_ms in times_ms])


def with_size(frame: bytes, size: int) -> bytes:
    return frame[:4] + size.to_bytes(2, "little") + frame[6:]


def bad(wrong: bytes) -> dict[str, Any]:
    return dropped(wrong, length=300)


EVEN = image(1, 600, rle=False)
UNKNOWN = weiss.encode(9, b"\0\x10\0", weiss.SEED_AFTER_PREAMBLE).hex()
CASES = {
    **{
        f"a matrix with a cell at full scale is saturated, runs: {rle}": Case(
            encode_frame([4094] * 8 + [0, 0, 4095, 0], 0, rle=rle),
            fields("status", [(), ("saturated",)]),
            options=FORMS,
        )
        for rle in (False, True)
    },
    "a run of zero cells adds nothing": Case(payload("00 00 00 00 01  07 00 05 10 00 00"), fields("values", [[5]])),
    "a value beyond 12 bits gives no image": Case(
        payload("00 00 00 00 00 FF 0F 00 10") + PLAIN, at_ms(1000), bad(payload("00 00 00 00 00 FF 0F 00 10"))
    ),
    **{
        f"an image without cells or with half a cell is rejected: {wrong}": Case(
            payload(wrong) + PLAIN, at_ms(1000), bad(payload(wrong))
        )
        for wrong in ("00 00 00 00 00", "00 00 00 00", "00 00 00 00 01 05 00", "00 00 00 00 00 05 00 07")
    },
    **{
        f"an image of {cells} cells is dropped whole, runs: {rle}": Case(
            image(0) + image(33, cells, rle=rle) + image(66),
            at_ms(0, 0, 66, 66),
            bad(image(33, cells, rle=rle)),
            FORMS,
        )
        for cells in (1, 11, 13, 24)
        for rle in (False, True)
    },
    **{
        f"{MAX_CELLS} cells are read, and one more is not, runs: {rle}": Case(
            encode_frame([9] * MAX_CELLS, 33, rle=rle) + encode_frame([9] * (MAX_CELLS + 1), 66, rle=rle),
            at_ms(33),
            bad(encode_frame([9] * (MAX_CELLS + 1), 66, rle=rle)),
        )
        for rle in (False, True)
    },
    "matrices may have odd sides or a single cell": Case(
        encode_frame(range(163), 0),
        fields("values", [list(range(84)), list(range(84, 162)), [162]]),
        options={"matrices": [[6, 14], [6, 13], [1, 1]]},
    ),
    "boot text is no damage": Case(b"\x1b[5n" * 3 + PLAIN + b"\x1b[5n", at_ms(1000)),
    "no length beyond the longest image is waited for": Case(
        with_size(PLAIN, 0xFFFF) + image(33), at_ms(33), bad(PLAIN)
    ),
    **{
        f"a length beyond the known matrices is rejected at the flags, runs: {frame is RLE}": Case(
            with_size(frame, 0x1F)[:11], [], bad(frame[:11]), FORMS
        )
        for frame in (PLAIN, RLE)
    },
    "a wrong length is found when the next image arrives": Case(
        with_size(EVEN, 4005) + image(33, 600, rle=False) + image(66, 600, rle=False), at_ms(33, 66), bad(EVEN)
    ),
    "a wrong length of long runs is found when the next image arrives": Case(
        with_size(image(1, 600), 2 * 590 + 5) + image(33, 600) + image(66, 600),
        at_ms(33, 66),
        bad(image(1, 600)),
        WIDE,
    ),
    **{
        f"a wrong length of {size} bytes is found once a whole packet follows": Case(
            with_size(image(0), size) + b"\xaa\xaa" + image(33), at_ms(33), bad(image(0) + b"\xaa\xaa")
        )
        for size in (101, 1001, 4001)
    },
    "what only looks like a packet is no sign of a wrong length": Case(
        encode_frame([0xAAA] * 10 + [0xAA] * 3 + [0] * 3, 33, rle=True)
        + payload("42 00 00 00 01" + UNKNOWN + "00 00 00" * (len(UNKNOWN) // 2 % 2)),
        at_ms(33, 66),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_D1_L3_T2_a_stream_gives_these_images_and_counts(name: str) -> None:
    CASES[name].check(dsacon32.Decoder)


@given(st.lists(st.integers(0, 4095) | st.just(0), min_size=1, max_size=300))
def test_run_lengths_give_back_what_they_encode(cells: list[int]) -> None:
    (sample,) = dsacon32.Decoder().receive(encode_frame(cells, 0, rle=True), 0)
    assert sample.values.tolist() == cells


def test_a_run_is_at_most_fifteen_cells_long() -> None:
    assert encode_frame([5] * 32, 0, rle=True)[11:-2] == bytes.fromhex("05 F0 05 F0 05 20")


def test_plain_images_may_be_asked_for() -> None:
    assert dsacon32.acquire(30, rle=False) + dsacon32.acquire(0, rle=False) == bytes.fromhex(
        "AA AA AA 03 03 00 80 1E 00 8E 1C AA AA AA 03 03 00 00 00 00 8D 00"
    )


MANY = "02 0C 00  00 00 FF FF 20 01 01 2E 16 00 00 00"
LARGE = "0B 34 00  00 00 9A 99 59 40 9A 99 59 40 FF FF FE FF" + "00" * 33 + "00 F0 7F 45 00"


@pytest.mark.parametrize(
    ("answers", "state"),
    [
        ([MANY], "a controller must have 1 to 16 matrices, got 65535"),
        ([MANY.replace("FF FF", "06 00"), LARGE], "the matrices must have at most 2048 cells, got 4294770690"),
    ],
)
def test_numbers_and_sides_of_matrices_are_unsigned(answers: list[str], state: str) -> None:
    """Fields: ``sSensorInfo`` and ``sMatrixInfo`` in ipab-slmc/SDHLibrary-CPP at 4ddc1d0, ``sdh/dsa.h``."""
    session = dsacon32.Session()
    session.start(0)
    for answer in map(bytes.fromhex, ["01 12 00 00 00 D2 04 00 00 20 20 01 80 10 01 00 00 00 00 00 00", *answers]):
        session.receive(weiss.PREAMBLE + answer + weiss.checksum(answer).to_bytes(2, "little"), 1)
        session.on_time(1)
    assert (session.identity, session.state) == ("S/N 1234", state)


@pytest.mark.parametrize(
    ("code", "word"), [(11, "checksum error"), (12, "not enough parameters"), (27, "range error"), (28, "status 28")]
)
def test_errors_are_numbered_as_this_controller_does(code: int, word: str) -> None:
    assert weiss.status_word(code, dsacon32.ERROR_WORDS) == word
