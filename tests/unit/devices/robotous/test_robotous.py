"""Robotous RFT: worked packets, a weak checksum, and a session that spares the sensor's EEPROM."""

from __future__ import annotations

from typing import Any

import pytest

from slipd.devices import robotous
from slipd.devices.robotous import STOP_PAUSE_NS
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.sensor_session import RETRY_PAUSE_NS
from slipd.tools.sim import emulated_robotous as sim

WORKED = bytes.fromhex("55 0B 02 69 FF 83 13 29 00 FA FF AC 00 03 08 00 00 E4 AA")
COUNTS = (617, -125, 4905, 250, -84, 3)


def reading(number: int) -> bytes:
    return sim.encode_reading((number, *COUNTS[1:]))


def numbers(samples: list[Any]) -> list[int]:
    return [round(sample.force_n[0] * 50) for sample in samples]


def test_the_worked_reading_is_written() -> None:
    assert sim.encode_reading(COUNTS, 0x08) == WORKED


def test_a_single_reading_on_request_is_read_too() -> None:
    assert len(robotous.Decoder().receive(sim.encode_reading(COUNTS, number=robotous.READ_ONCE), 0)) == 1


@pytest.mark.parametrize("bit", range(8))
def test_F2_every_overload_bit_is_overload_and_the_others_give_no_reading(bit: int) -> None:
    samples = robotous.Decoder().receive(sim.encode_reading(COUNTS, 1 << bit), 0)
    assert [sample.status for sample in samples] == ([("overload",)] if bit < 6 else [])


@pytest.mark.parametrize("rail", [-32768, 32767])
def test_N3_a_count_at_the_end_of_its_range_is_overload(rail: int) -> None:
    (sample,) = robotous.Decoder().receive(sim.encode_reading((*COUNTS[:5], rail)), 0)
    assert sample.status == ("overload",)


def test_L3_out_of_sync_unused_bytes_must_be_zero_and_in_sync_they_need_not() -> None:
    odd = sim.encode_response(robotous.START, bytes(13) + b"\1\2")
    decoder = robotous.Decoder()
    assert len(decoder.receive(b"\0" + odd + odd, 0)) == 1
    assert decoder.health == DecoderHealth(good=1, bad=2, bad_bytes=1)


@pytest.mark.parametrize(
    ("command", "wire"),
    [
        ((robotous.START, b""), "55 0B 00 00 00 00 00 00 00 0B AA"),
        ((robotous.STOP, b""), "55 0C 00 00 00 00 00 00 00 0C AA"),
        ((robotous.SET_RATE, b"\x05"), "55 0F 05 00 00 00 00 00 00 14 AA"),
        ((robotous.SET_FILTER, b"\x01\x0a"), "55 08 01 0A 00 00 00 00 00 13 AA"),
        ((robotous.PRODUCT_NAME, b""), "55 01 00 00 00 00 00 00 00 01 AA"),
        ((robotous.SERIAL_NUMBER, b""), "55 02 00 00 00 00 00 00 00 02 AA"),
        ((robotous.GET_FILTER, b""), "55 09 00 00 00 00 00 00 00 09 AA"),
        ((robotous.READ_ONCE, b""), "55 0A 00 00 00 00 00 00 00 0A AA"),
        ((robotous.GET_RATE, b""), "55 10 00 00 00 00 00 00 00 10 AA"),
    ],
)
def test_the_worked_commands_are_written_and_read(command: tuple[int, bytes], wire: str) -> None:
    """By the numbers and packets of the maker's driver, ``RFT_IF_PACKET_Rev1.2.cpp`` beside the file named above."""
    number, arguments = command
    assert robotous.encode_command(number, arguments) == bytes.fromhex(wire)
    assert sim.parse_commands(bytes.fromhex(wire)) == ([(number, arguments.ljust(7, b"\0"))], b"")


def test_commands_are_read_from_any_split_and_after_noise() -> None:
    stop = robotous.encode_command(robotous.STOP)
    stream = b"\x01\x55" + stop + stop[:5] + stop + b"\x07"
    heard, commands = b"", []
    for byte in stream:
        found, heard = sim.parse_commands(heard + bytes((byte,)))
        commands += found
    assert [number for number, _ in commands] == [robotous.STOP] * 2
    assert heard == b""


def test_a_name_that_is_not_text_is_empty() -> None:
    assert robotous.parse_name(b"RFT40-SA01\0\0\0\0\0") == "RFT40-SA01"
    assert robotous.parse_name(b"\xff\x01" * 7) == ""


def answer(session: robotous.Session, number: int, content: bytes = b"", now_ns: int = 100) -> bytes:
    session.receive(sim.encode_response(number, content), now_ns)
    return session.on_time(now_ns)


def asked(**options: Any) -> robotous.Session:
    """Return a session that has stopped the sensor and requested its rate."""
    session = robotous.Session(**options)
    assert session.start(0) == robotous.encode_command(robotous.STOP)
    assert session.on_time(STOP_PAUSE_NS - 1) == b""
    assert session.on_time(STOP_PAUSE_NS) == robotous.encode_command(robotous.GET_RATE)
    return session


def test_settings_that_differ_are_written_and_the_names_requested() -> None:
    session = asked(output_hz=1000, filter_hz=100)
    assert answer(session, robotous.GET_RATE, b"\x05") == robotous.encode_command(robotous.SET_RATE, b"\x08")
    assert answer(session, robotous.SET_RATE, b"\1\0") == robotous.encode_command(robotous.GET_FILTER)
    assert answer(session, robotous.GET_FILTER, b"\0\0") == robotous.encode_command(robotous.SET_FILTER, b"\x01\x05")
    assert answer(session, robotous.SET_FILTER, b"\1\0") == robotous.encode_command(robotous.PRODUCT_NAME)
    assert answer(session, robotous.PRODUCT_NAME, b"RFT40") == robotous.encode_command(robotous.SERIAL_NUMBER)
    assert answer(session, robotous.SERIAL_NUMBER, b"2211") == robotous.encode_command(robotous.START)
    assert session.state == "configuring"
    session.receive(WORKED, 101)
    assert (session.state, session.identity) == ("running", "RFT40 2211")


@pytest.mark.parametrize(("rate", "hz"), [(0, 200), (5, 200), (8, 1000)])
@pytest.mark.parametrize(("kept", "filter_hz"), [(b"\0\0", 0), (b"\0\x07", 0), (b"\1\x01", 500)])
def test_settings_that_agree_are_not_written_again(rate: int, hz: int, kept: bytes, filter_hz: int) -> None:
    session = asked(output_hz=hz, filter_hz=filter_hz)
    assert answer(session, robotous.GET_RATE, bytes((rate,))) == robotous.encode_command(robotous.GET_FILTER)
    assert answer(session, robotous.GET_FILTER, kept) == robotous.encode_command(robotous.PRODUCT_NAME)


def test_an_unknown_rate_is_overwritten() -> None:
    assert answer(asked(output_hz=200), robotous.GET_RATE, b"\x63") == robotous.encode_command(
        robotous.SET_RATE, b"\x05"
    )


@pytest.mark.parametrize(
    ("code", "word"), [(1, "not supported"), (2, "value out of range"), (3, "EEPROM write failure"), (9, "code 9")]
)
def test_a_refusal_is_named_and_the_setting_repeated(code: int, word: str) -> None:
    session = asked(output_hz=200, filter_hz=100)
    answer(session, robotous.GET_RATE, b"\x05")
    setting = answer(session, robotous.GET_FILTER, b"\0\0")
    assert answer(session, robotous.SET_FILTER, bytes((0, code))) == b""
    assert session.state == f"refused filter: {word}"
    assert session.on_time(100 + RETRY_PAUSE_NS) == setting


def test_a_refused_rate_leaves_the_sensor_its_own_and_is_noted() -> None:
    session = asked(output_hz=500)
    answer(session, robotous.GET_RATE, b"\x05")
    assert answer(session, robotous.SET_RATE, b"\0\x02") == robotous.encode_command(robotous.GET_FILTER)
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
        session = asked(output_hz=200, filter_hz=hz)
        answer(session, robotous.GET_RATE, b"\0")
        setting = answer(session, robotous.GET_FILTER, b"\0\0")
        assert setting == robotous.encode_command(robotous.SET_FILTER, bytes((1, code)))
    assert setting == A_USERS_FILTER
    for hz, code in RATE_CODES.items():
        setting = answer(asked(output_hz=hz), robotous.GET_RATE, b"\x63")
        assert setting == robotous.encode_command(robotous.SET_RATE, bytes((code,)))


def test_an_answer_to_something_else_is_skipped() -> None:
    session = asked()
    assert answer(session, robotous.SET_RATE, b"\1\0") == b""
    assert session.state == "waiting"
