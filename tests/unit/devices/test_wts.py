"""Images and requests of the WTS module: worked packets, incomplete streams, and images that do not fit the matrix."""

from __future__ import annotations

import numpy as np
import pytest

from slipd.devices import wts
from slipd.devices.shared import weiss_packets as weiss
from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE
from slipd.tools.sim import emulated_wts as sim

CELLS = [0, 0, 0, 0, 0, 12, 80, 0, 5, 300, 1290, 40, 0, 260, 2047, 33, 0, 20, 150, 9, *[0] * 12]
WORKED = bytes.fromhex(
    "AA AA AA 00 45 00 40 E2 01 00 00 00 00 00 00 00 00 00 00 00 00 0C 00 50 00 00 00 05 00 2C 01 0A 05 28 00 00 00 04"
    "01 FF 07 21 00 00 00 14 00 96 00 09 00" + "00" * 24 + "A5 81"
)
"""Computed from the drivers' field table; not recorded from a module."""


def frames(count: int, cells: int = 32) -> list[bytes]:
    rng = np.random.default_rng(4)
    return [wts.encode_frame(rng.integers(0, 4095, cells), 10 * number) for number in range(count)]


def times_ms(decoder: wts.Decoder, *stream: bytes) -> list[int]:
    samples = decoder.receive(b"".join(stream), 0)
    return [sample.device_time_ns // 1_000_000 for sample in samples if sample.device_time_ns is not None]


def test_the_worked_image_is_written() -> None:
    assert wts.encode_frame(CELLS, 123_456) == WORKED


def test_the_serial_number_stands_in_the_system_information_as_weiss_documents_it_for_the_wsg() -> None:
    session = wts.Session()
    assert session.start(0) == bytes.fromhex("AA AA AA 50 00 00 DB 87")
    session.receive(bytes.fromhex("AA AA AA 50 0A 00 00 00 01 00 34 12 78 56 34 92 C5 81"), 1)
    assert session.identity == "S/N 2452903544"


def test_the_sides_and_the_full_scale_of_the_matrix_are_unsigned() -> None:
    session = wts.Session()
    session.start(0)
    session.receive(sim.encode_system(1), 1)
    session.on_time(1)
    answer = bytes.fromhex("AA AA AA 30 0C 00  00 00 FF FF FE FF 54 01 54 01 FD FF")
    session.receive(answer + weiss.checksum(answer).to_bytes(2, "little"), 1)
    assert session.state.startswith("matrix of 65535 x 65534 cells of 65533 counts")


def test_an_image_with_a_cell_at_full_scale_is_saturated() -> None:
    decoder = wts.Decoder()
    assert decoder.receive(wts.encode_frame([4095], 0), 0)[0].status == ("saturated",)
    assert decoder.receive(wts.encode_frame([4094], 0), 0)[0].status == ()
    decoder.set_matrix(wts.Matrix(1, 1, 1000))
    assert decoder.receive(wts.encode_frame([1000], 0), 0)[0].status == ("saturated",)


@pytest.mark.parametrize("cells", [1, 31, 33, 64])
def test_T2_an_image_of_another_size_than_the_matrix_is_dropped_whole(cells: int) -> None:
    decoder = wts.Decoder()
    decoder.set_matrix(wts.Matrix())
    one, _, three = frames(3)
    assert times_ms(decoder, one, *frames(1, cells), three) == [0, 20]
    assert decoder.health.bad > 0


def test_T2_two_images_mixed_are_dropped_whole() -> None:
    one, two, three = frames(3)
    for cut in range(7, len(one) - 2):
        mixed = one[:cut] + two[cut:]
        assert times_ms(wts.Decoder(), mixed, three) == ([10, 20] if mixed == two else [20])


def test_D2_a_run_length_encoded_image_is_rejected() -> None:
    flagged = weiss.encode(0, bytes(4) + b"\x01\x05\x00", SEED_WITH_PREAMBLE)
    assert times_ms(wts.Decoder(), flagged, WORKED) == [123_456]


def test_a_value_beyond_full_scale_gives_no_image() -> None:
    decoder = wts.Decoder()
    assert decoder.receive(wts.encode_frame([4096], 0), 0) == []
    decoder.set_matrix(wts.Matrix(1, 1, 1000))
    assert decoder.receive(wts.encode_frame([1001], 0), 0) == []


@pytest.mark.parametrize(
    ("made", "sent"),
    [
        (wts.encode_start(10), "21 03 00 00 0A 00 DA B5"),
        (wts.encode_query(wts.STOP), "22 00 00 0E 76"),
        (wts.encode_query(wts.MATRIX), "30 00 00 CA CF"),
        (wts.encode_query(wts.SYSTEM), "50 00 00 DB 87"),
        (sim.encode_matrix(wts.Matrix()), "30 0C 00 00 00 04 00 08 00 54 01 54 01 FF 0F C5 81"),
    ],
)
def test_worked_requests_and_answers_are_written(made: bytes, sent: str) -> None:
    assert made == bytes.fromhex("AA AA AA" + sent)


def test_the_interval_of_a_request_is_read() -> None:
    assert sim.parse_start(wts.encode_start(250)[6:-2]) == 250


def test_a_single_image_is_written_as_drivers_read_it() -> None:
    answer = sim.encode_single(np.arange(3, dtype="<u2"), 1234)
    head = bytes.fromhex("AAAAAA 20 0D00 0000 D2040000 00")  # id, length, status, time in ms, flags
    assert answer[:-2] == head + bytes.fromhex("0000 0100 0200")
