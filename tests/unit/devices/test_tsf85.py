"""TSF-85 packets: every block and fault of their tags, repeated arrays, and packets that may be noise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from readings import Case, dropped, fields

from slipd.devices import tsf85
from slipd.devices.tsf85 import encode_packet
from slipd.tools.sim.emulated_pads import encode_block

KINDS = bytes.fromhex(
    f"9A 00 61 4C 50 00 01 00 02 00 03 60 0C E4 70 00 00 00 00 00 00 6C 1F 10 {28 * '01 2C '}"
    "9A 00 59 03 60 0C E4 9A 00 E3 06 31 2E 32 2E 33 00"
)
"""By the maker's table of sizes and commands (``sensor_quickstart/protocol.py`` at 8cb0219): a packet that was asked
for, with magnetometer (6 bytes), temperature (2), time (8) and array (56), one that came by itself, and a version."""

DYNAMIC = encode_block(tsf85.DYNAMIC, 0, [4])
SMALL = encode_packet(tsf85.AUTOSEND, DYNAMIC + encode_block(tsf85.DYNAMIC, 1, [-3]))


def image(number: int, finger: int = 0) -> np.ndarray:
    return np.random.default_rng((number, finger)).integers(0, 1 << 16, tsf85.TAXELS)


def packet(number: int, *, both: bool = False) -> bytes:
    """Return a packet with the image of the number and the other blocks."""
    blocks = b""
    for finger in range(1 + both):
        blocks += encode_block(tsf85.STATIC, finger, image(number, finger))
        blocks += encode_block(tsf85.DYNAMIC, finger, [number - 7])
        blocks += encode_block(tsf85.ACCELEROMETER, finger, [1, -2, 3])
    return encode_packet(tsf85.AUTOSEND, blocks + encode_block(tsf85.TIMESTAMP, 0, [1000 * number]))


def images(*numbers: int) -> list[dict[str, Any]]:
    return [{"values": image(number), "source": "0", "device_time_ns": None} for number in numbers]


WRONG = {
    "no content": encode_packet(tsf85.AUTOSEND),
    "an unknown command": encode_packet(0x57, DYNAMIC),
    "the command of the bootloader": encode_packet(0xE2, DYNAMIC),
    "a block twice": encode_packet(tsf85.AUTOSEND, DYNAMIC + DYNAMIC),
    "half a block at the end": encode_packet(tsf85.AUTOSEND, DYNAMIC + b"\x24\0"),
    "a tag at the end": encode_packet(tsf85.AUTOSEND, DYNAMIC + b"\x24"),
    "a third finger": encode_packet(tsf85.AUTOSEND, b"\x28\0\0"),
    "a reserved bit": encode_packet(tsf85.AUTOSEND, b"\x21\0\0"),
    "type 0": encode_packet(tsf85.AUTOSEND, b"\0\0\0"),
    "a tag of a later firmware": encode_packet(tsf85.AUTOSEND, encode_block(tsf85.STATIC, 0, image(1)) + b"\x80\1\2"),
    "a version that is no text": encode_packet(tsf85.VERSION, b"1.1.8\x80"),
    "no version": encode_packet(tsf85.VERSION),
}
CASES = {
    **{
        f"a packet with {what} is rejected": Case(
            packet(0) + wrong + packet(1) + packet(2), images(0, 1, 2), dropped(wrong, length=48)
        )
        for what, wrong in WRONG.items()
    },
    "a packet without an array gives no image and is no damage": Case(SMALL * 3, []),
    "blocks of every kind, and packets of every command": Case(KINDS, fields("values", [[300] * 28])),
    "each finger is a source, and has its own time where its unit is given": Case(
        packet(5, both=True),
        [
            {"source": "0", "values": image(5), "device_time_ns": 5_000_000},
            {"source": "1", "values": image(5, 1), "device_time_ns": None},
        ],
        options={"timestamp_unit_ns": 1000},
    ),
    "the time of the second finger is its own": Case(
        encode_packet(
            tsf85.AUTOSEND, encode_block(tsf85.TIMESTAMP, 1, [7]) + encode_block(tsf85.STATIC, 1, image(1, 1))
        ),
        [{"source": "1", "values": image(1, 1), "device_time_ns": 7000}],
        options={"timestamp_unit_ns": 1000},
    ),
    "out of sync, a packet without a next one is dropped": Case(
        b"\0" + packet(0) + b"\0" + packet(1) + packet(2), images(1, 2), {"bad": 3, "bad_bytes": 2}
    ),
    "a wrong length delays nothing beyond its first wrong tag": Case(
        b"\x9a\0\x58\xff" + packet(1) + packet(2), images(1, 2), {"bad": 1, "bad_bytes": 4}
    ),
    **{
        f"a packet cut after byte {cut} is dropped whole": Case(
            packet(0) + packet(1)[:cut] + packet(2) + packet(3), images(0, 2, 3), dropped(packet(1)[:cut], length=48)
        )
        for cut in (1, 3, 4, 30, 60)
    },
}


@pytest.mark.parametrize("name", CASES)
def test_D2_T2_L3_a_stream_gives_these_images_and_counts(name: str) -> None:
    CASES[name].check(tsf85.Decoder)


def test_an_array_is_an_image_once_per_refresh_and_one_that_stays_is_repeated() -> None:
    decoder, ms = tsf85.Decoder(), 1_000_000
    sent = [decoder.receive(packet(1 + (n > 29), both=True), n * ms) for n in range(55)]
    assert [n for n, samples in enumerate(sent) if samples] == [0, 20, 30, 50]
    decoder.forget()
    assert len(decoder.receive(packet(2, both=True), 55 * ms)) == 2


@pytest.mark.parametrize(
    ("stream", "firmware"),
    [
        (KINDS, "1.2.3"),
        (encode_packet(tsf85.VERSION, b"Master 1.1.8\r\n\0"), "Master 1.1.8"),
        (b"\0" + encode_packet(tsf85.VERSION, b"1.1.8"), ""),
        (b"\0" + encode_packet(tsf85.VERSION, b"1.1.8") + SMALL, "1.1.8"),
    ],
)
def test_the_firmware_is_read_from_its_answer(stream: bytes, firmware: str) -> None:
    session = tsf85.Session()
    session.start(0)
    session.on_time(1 << 30)
    session.receive(stream, 1 << 30)
    assert session.identity == firmware


def test_L5_out_of_sync_a_packet_is_returned_with_the_next_one_unless_the_line_was_unplugged_between() -> None:
    decoder = tsf85.Decoder()
    assert decoder.receive(b"\0" + packet(0), 5) == []
    assert [sample.t_ns for sample in decoder.receive(packet(1), 7)] == [5, 7]
    assert decoder.receive(b"\0" + packet(4), 8) == []
    decoder.forget()
    assert [sample.values.tolist() for sample in decoder.receive(packet(5), 9)] == [image(5).tolist()]
    assert decoder.health.bad == 3
