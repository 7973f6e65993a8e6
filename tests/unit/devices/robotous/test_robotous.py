"""Robotous RFT: every overload bit, a weak checksum, and a session that spares the sensor's EEPROM."""

from __future__ import annotations

from typing import Any

import pytest
from readings import Case, fields

from slipd.devices import robotous
from slipd.devices.robotous import STOP_PAUSE_NS, encode_command
from slipd.devices.shared.sensor_session import RETRY_PAUSE_NS
from slipd.tools.sim import emulated_wrenches as sim

COUNTS = (617, -125, 4905, 250, -84)
ODD = sim.encode_response(robotous.START, bytes(13) + b"\1\2")

CASES = {
    "a single reading on request is read too": Case(
        sim.encode_reading((*COUNTS, 3), number=robotous.READ_ONCE), fields("status", [()])
    ),
    "every overload bit is overload, and the others give no reading": Case(
        b"".join(sim.encode_reading((*COUNTS, 3), 1 << bit) for bit in range(8)),
        fields("status", [("overload",)] * 6),
        {"bad": 2, "bad_bytes": 38},
    ),
    "a count at the end of its range is overload": Case(
        b"".join(sim.encode_reading((*COUNTS, rail)) for rail in (-32768, 32767)), fields("status", [("overload",)] * 2)
    ),
    "out of sync, unused bytes must be zero, and in sync they need not": Case(
        b"\0" + ODD + ODD, fields("status", [()]), {"bad": 2, "bad_bytes": 1}
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_F2_N3_L3_a_stream_gives_these_readings_and_counts(name: str) -> None:
    CASES[name].check(robotous.Decoder)


def test_a_name_that_is_not_text_is_empty() -> None:
    assert robotous.parse_name(b"RFT40-SA01\0\0\0\0\0") == "RFT40-SA01"
    assert robotous.parse_name(b"\xff\x01" * 7) == ""


def talk(*answers: tuple[int, bytes], **options: Any) -> tuple[list[bytes], robotous.Session]:
    """Return what a session asks after each answer to it, from the request of the rate on, and the session."""
    session = robotous.Session(**options)
    assert session.start(0) == encode_command(robotous.STOP)
    assert session.on_time(STOP_PAUSE_NS - 1) == b""
    asked = [session.on_time(STOP_PAUSE_NS)]
    for number, content in answers:
        session.receive(sim.encode_response(number, content), 100)
        asked.append(session.on_time(100))
    return asked, session


GET_RATE, GET_FILTER = encode_command(robotous.GET_RATE), encode_command(robotous.GET_FILTER)


def test_settings_that_differ_are_written_and_the_names_requested() -> None:
    asked, session = talk(
        (robotous.SET_RATE, b"\1\0"),  # an answer to something else is skipped
        (robotous.GET_RATE, b"\x05"),
        (robotous.SET_RATE, b"\1\0"),
        (robotous.GET_FILTER, b"\0\0"),
        (robotous.SET_FILTER, b"\1\0"),
        (robotous.PRODUCT_NAME, b"RFT40"),
        (robotous.SERIAL_NUMBER, b"2211"),
        output_hz=1000,
        filter_hz=100,
    )
    set_rate, set_filter = encode_command(robotous.SET_RATE, b"\x08"), encode_command(robotous.SET_FILTER, b"\1\5")
    then = map(encode_command, (robotous.PRODUCT_NAME, robotous.SERIAL_NUMBER, robotous.START))
    assert asked == [GET_RATE, b"", set_rate, GET_FILTER, set_filter, *then]
    assert (session.state, session.identity) == ("configuring", "RFT40 2211")
    session.receive(sim.encode_reading((*COUNTS, 3)), 101)
    assert session.state == "running"


@pytest.mark.parametrize(("rate", "hz"), [(0, 200), (5, 200), (8, 1000)])
@pytest.mark.parametrize(("kept", "filter_hz"), [(b"\0\0", 0), (b"\0\x07", 0), (b"\1\x01", 500)])
def test_settings_that_agree_are_not_written_again(rate: int, hz: int, kept: bytes, filter_hz: int) -> None:
    answers = (robotous.GET_RATE, bytes((rate,))), (robotous.GET_FILTER, kept)
    asked, _ = talk(*answers, output_hz=hz, filter_hz=filter_hz)
    assert asked == [GET_RATE, GET_FILTER, encode_command(robotous.PRODUCT_NAME)]


@pytest.mark.parametrize(
    ("code", "word"), [(1, "not supported"), (2, "value out of range"), (3, "EEPROM write failure"), (9, "code 9")]
)
def test_a_refusal_is_named_and_the_setting_repeated(code: int, word: str) -> None:
    asked, session = talk(
        *((robotous.GET_RATE, b"\x05"), (robotous.GET_FILTER, b"\0\0"), (robotous.SET_FILTER, bytes((0, code)))),
        output_hz=200,
        filter_hz=100,
    )
    assert (asked[-1], session.state) == (b"", f"refused filter: {word}")
    assert session.on_time(100 + RETRY_PAUSE_NS) == asked[-2]


def test_a_refused_rate_leaves_the_sensor_its_own_and_is_noted() -> None:
    asked, session = talk((robotous.GET_RATE, b"\x05"), (robotous.SET_RATE, b"\0\x02"), output_hz=500)
    assert asked[-1] == GET_FILTER
    assert session.health.note.startswith("refused rate: value out of range; it keeps its own rate")
    session.start(200)
    assert session.health.note == ""


FILTER_CODES = {500: 1, 300: 2, 200: 3, 150: 4, 100: 5, 50: 6, 40: 7, 30: 8, 20: 9, 10: 10, 5: 11, 3: 12, 2: 13, 1: 14}
RATE_CODES = {10: 1, 20: 2, 50: 3, 100: 4, 200: 5, 333: 6, 500: 7, 1000: 8}
"""Tables of the maker's ROS 2 driver: ROBOTOUS/ROS-2-Interface-for-RFT-Series-UART-Model at 057c534,
``rft_sensor_serial/src/rft_sensor_serial.cpp``, lines 28 and 29 (where 100 Hz stands for code 6 too)."""

A_USERS_FILTER = bytes.fromhex("55 08 01 0E 00 00 00 00 00 17 AA")
"""A filter of 1 Hz for an RFT40: nsaitarun-git/Robotous_RFT40_MATLAB_Example at 85afe5a, ``main.m`` line 69."""


def test_the_codes_are_those_of_the_makers_driver() -> None:
    for hz, code in FILTER_CODES.items():
        asked, _ = talk((robotous.GET_RATE, b"\0"), (robotous.GET_FILTER, b"\0\0"), output_hz=200, filter_hz=hz)
        assert asked[-1] == encode_command(robotous.SET_FILTER, bytes((1, code)))
    assert asked[-1] == A_USERS_FILTER
    for hz, code in RATE_CODES.items():
        asked, _ = talk((robotous.GET_RATE, b"\x63"), output_hz=hz)
        assert asked[-1] == encode_command(robotous.SET_RATE, bytes((code,))), "an unknown rate is overwritten"
