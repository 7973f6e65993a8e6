"""Images of the WTS module: which fit the matrix, which are saturated; and the answers about the module."""

from __future__ import annotations

import pytest
from readings import Case, dropped, fields

from slipd.devices import wts
from slipd.devices.shared import weiss_packets as weiss
from slipd.tools.sim.emulated_weiss import encode_wts_frame

WTS_FT, SMALL = (32, 4095), (1, 1000)
RUNS = weiss.encode(0, bytes(4) + b"\x01\x05\x00", weiss.SEED_WITH_PREAMBLE)


def decoder(matrix: tuple[int, int] | None = None) -> wts.Decoder:
    made = wts.Decoder()
    if matrix is not None:
        made.set_matrix(*matrix)
    return made


def image(cell: int, cells: int = 1) -> bytes:
    return encode_wts_frame([cell] * cells, 0)


CASES = {
    "an image with a cell at full scale is saturated": Case(
        image(4094) + image(4095), fields("status", [(), ("saturated",)])
    ),
    "the matrix has its own full scale": Case(
        image(999) + image(1000), fields("status", [(), ("saturated",)]), options={"matrix": SMALL}
    ),
    "a value beyond full scale gives no image": Case(image(4096), [], dropped(image(4096), length=77)),
    "a value beyond the full scale of the matrix gives no image": Case(
        image(1001), [], dropped(image(1001), length=77), {"matrix": SMALL}
    ),
    **{
        f"an image of {cells} cells is dropped whole": Case(
            image(1, 32) + image(2, cells) + image(3, 32),
            fields("values", [[1] * 32, [3] * 32]),
            dropped(image(2, cells), length=77),
            {"matrix": WTS_FT},
        )
        for cells in (1, 31, 33, 64)
    },
    "a run-length encoded image is rejected": Case(RUNS + image(7), fields("values", [[7]]), dropped(RUNS, length=77)),
}


@pytest.mark.parametrize("name", CASES)
def test_D2_T2_a_stream_gives_these_images_and_counts(name: str) -> None:
    CASES[name].check(decoder)


def test_the_answers_about_the_module_are_read_as_documented() -> None:
    """The system information as Weiss documents it for the WSG; the sides and the full scale are unsigned."""
    session = wts.Session()
    assert session.start(0) == bytes.fromhex("AA AA AA 50 00 00 DB 87")
    session.receive(bytes.fromhex("AA AA AA 50 0A 00 00 00 01 00 34 12 78 56 34 92 C5 81"), 1)
    assert session.identity == "S/N 2452903544"
    session.on_time(1)
    matrix = bytes.fromhex("AA AA AA 30 0C 00  00 00 FF FF FE FF 54 01 54 01 FD FF")
    session.receive(matrix + weiss.checksum(matrix).to_bytes(2, "little"), 1)
    assert session.state.startswith("matrix of 65535 x 65534 cells of 65533 counts")
