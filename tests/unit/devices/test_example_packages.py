"""The example packages of clients/examples/devices, on bytes as their published sources give them."""

from __future__ import annotations

import random

import numpy as np
import pytest
import slipd_anyskin
import slipd_paxini
from readings import Case, fields
from slipd_paxini import POLL_NS, REPLY_TIMEOUT_NS

EFLESH_UT = np.array(
    (604.800048828125, 158.40000915527344, 9439.935546875, 1531.2000732421875, -357.6000061035156, 11302.3681640625,
     -273.6000061035156, 1024.800048828125, 10988.736328125, 768.0, 213.60000610351562, 9912.3203125,
     -144.0, 2004.0001220703125, 11828.9599609375)
).reshape(5, 3)  # fmt: skip
"""First row of normal_force/20250401_014340_probe/sensor.csv in the eFlesh repository: as the board sent it."""

FRAME = slipd_anyskin.encode_frame(EFLESH_UT)


WILD = slipd_anyskin.encode_frame(np.full((5, 3), 1e9))
NOISE = random.Random(1).randbytes(20_000)


def test_anyskin_noise_gives_nothing_and_no_sensor_has_no_taxels() -> None:
    decoder = slipd_anyskin.Decoder()
    assert (decoder.receive(NOISE, 0), decoder.health.bad_bytes > 19_900) == ([], True)
    with pytest.raises(ValueError, match="from 1 to 16, got 0"):
        slipd_anyskin.Decoder(0)


def reply(x: int, y: int, z: int, end: bytes = b"") -> bytes:
    return b"\xaa\x55" + bytes(12) + bytes((x & 0xFF, y & 0xFF, z)) + end


def test_paxini_the_request_is_that_of_the_makers_program() -> None:
    assert slipd_paxini.encode_request(2) == bytes.fromhex("55AA09000300FBF003000003 00 04")


CASES = {
    "anyskin: a published reading": (
        slipd_anyskin.Decoder,
        Case(b"\r\n" + FRAME, [{"values": EFLESH_UT, "status": ("raw",)}], {"bad_bytes": 2, "bad": 1}),
    ),
    "anyskin: bytes that were lost": (
        slipd_anyskin.Decoder,
        Case(FRAME + FRAME[16:] + 2 * FRAME, [{"values": EFLESH_UT}] * 3, {"bad_bytes": 66, "bad": 1}),
    ),
    "anyskin: values that no sensor has": (
        slipd_anyskin.Decoder,
        Case(b"\r\n" + FRAME + WILD + FRAME, [{"values": EFLESH_UT}] * 2, {"bad_bytes": 84, "bad": 2}),
    ),
    **{
        f"paxini: x and y are signed, z is not, and {len(end)} bytes follow": (
            slipd_paxini.Decoder,
            Case(
                b"\x00" + 3 * reply(-3, 20, 200, end),
                [{"force_n": [-0.3, 2.0, 20.0], "torque_nm": None, "status": ()}] * 3,
                {"bad": 1, "bad_bytes": 1},
            ),
        )
        for end in (b"", b"\x42")
    },
    "paxini: each axis at the end of its range": (
        slipd_paxini.Decoder,
        Case(reply(127, 0, 0) + reply(0, -128, 0) + reply(0, 0, 255), fields("status", [("overload",)] * 3)),
    ),
    "paxini: two bytes follow": (
        slipd_paxini.Decoder,
        Case(
            reply(1, 1, 1, b"\x42") + reply(1, 1, 1, b"\x42\x43") + reply(1, 1, 1), [{}] * 3, {"bad": 1, "bad_bytes": 1}
        ),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_stream_gives_these_readings_and_counts(name: str) -> None:
    decoder, case = CASES[name]
    case.check(decoder)


def test_paxini_one_poll_is_outstanding_in_its_period_and_a_lost_one_is_repeated() -> None:
    session = slipd_paxini.Session(module=1)
    assert (session.state, session.next_deadline(), session.on_time(5)) == ("closed", None, b"")
    request = slipd_paxini.encode_request(1)
    assert session.start(0) == request
    assert session.on_time(REPLY_TIMEOUT_NS - 1) == b""
    assert session.on_time(REPLY_TIMEOUT_NS) == request
    for late_ns in (0, 3_000_000, 0):
        due_ns = REPLY_TIMEOUT_NS + late_ns
        (_,) = session.receive(reply(0, 0, 0), due_ns + 1_000_000)
    assert (session.state, session.next_deadline()) == ("running", REPLY_TIMEOUT_NS + POLL_NS)
    assert session.on_time(REPLY_TIMEOUT_NS + POLL_NS + 3_000_000) == request
    session.receive(reply(0, 0, 0), REPLY_TIMEOUT_NS + POLL_NS + 4_000_000)
    assert session.next_deadline() == REPLY_TIMEOUT_NS + 2 * POLL_NS, "a late poll delays none of the next"
    assert session.stop() == b""
    assert session.receive(reply(0, 0, 0), 0)
    assert session.state == "closed"
    with pytest.raises(ValueError, match="from 0 to 7, got 8"):
        slipd_paxini.Session(module=8)
