"""OptoForce on its two wirings: published and worked frames, status names, and the session on each."""

from __future__ import annotations

import pytest

from slipd.devices import optoforce
from slipd.devices.optoforce import optoforce_frames as frames
from slipd.devices.shared import rdt_records as rdt
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.sensor_session import RETRY_PAUSE_NS
from slipd.tools.sim import emulated_optoforce as sim

PUBLISHED = bytes.fromhex("AA 07 08 0A 2D 6A 00 00 FF F7 FF FB 00 07 05 51")
"""From a capture of a three-axis sensor."""
SIX_AXES = bytes.fromhex("AA 07 08 10 03 E8 00 80 00 FA FF 83 0B B8 00 28 FF D8 00 07 07 79")
RECORD = bytes.fromhex(
    "00 00 00 01 00 00 01 F4 00 00 00 00 00 01 E2 40 FF FF 9E 58 00 0E F8 08 00 00 3A 98 FF FF EF 98 00 00 00 03"
)
ACK = bytes.fromhex("AA 00 50 01 00 00 FB")
SERIAL = frames.encode_frame(frames.SERIAL_NUMBER, b"ISE12 \0\0")


def reading(counter: int) -> bytes:
    return sim.encode_reading((counter % 100, -5, 7, 1, 2, 3), counter)


def udp(number: int, status: int = 0) -> bytes:
    return rdt.encode_record((1, 2, 3, 4, 5, 6), number, 1000 + number, status)


@pytest.mark.parametrize("channel", range(4))
def test_one_sensor_of_four_is_returned(channel: int) -> None:
    frame = sim.encode_reading(tuple(range(12)), 1)
    assert len(frame) == 34
    (sample,) = optoforce.Decoder(channel=channel).receive(frame, 0)
    assert sample.force_n.tolist() == [3 * channel, 3 * channel + 1, 3 * channel + 2]
    assert sample.torque_nm is None
    assert sample.source == ""


def words_of(bit: int) -> tuple[str, ...]:
    return {
        **{number: (f"sensor_{1 << number}",) for number in range(3)},
        3: ("several_sensors",),
        **dict.fromkeys(range(4, 10), ("overload",)),
        10: ("not_detected", "invalid"),
        11: ("sensor_failure", "invalid"),
        12: ("temperature",),
        13: ("daq_error", "invalid"),
        14: ("daq_communication", "invalid"),
        15: ("daq_error", "invalid"),
    }.get(bit, ("unknown",))


def test_F2_every_status_bit_has_its_words_on_both_wirings() -> None:
    for bit in range(32):
        stream = b"".join(udp(number, 1 << bit) for number in range(1, 5))
        assert optoforce.Decoder("udp").receive(stream, 0)[-1].status == words_of(bit)
        if bit < 16:
            assert optoforce.Decoder().receive(sim.encode_reading((1, 2, 3), 1, 1 << bit), 0)[0].status == words_of(bit)


def test_F2_an_error_without_a_name_is_invalid_nevertheless() -> None:
    (sample,) = optoforce.Decoder().receive(sim.encode_reading((1, 2, 3), 1, 3 << 10 | 7 << 13), 0)
    assert sample.status == ("sensor_error", "invalid", "daq_error")


@pytest.mark.parametrize("rail", [-32768, 32767])
def test_N3_a_count_at_the_end_of_its_range_is_overload(rail: int) -> None:
    (sample,) = optoforce.Decoder().receive(sim.encode_reading((1, 2, rail), 1), 0)
    assert sample.status == ("overload",)
    (sample,) = optoforce.Decoder(channel=0).receive(sim.encode_reading((1, 2, 3, *[rail] * 9), 1), 0)
    assert sample.status == ()


def test_D3_gap_duplicate_and_restart_are_distinguished() -> None:
    decoder = optoforce.Decoder()
    for counter in (65_534, 65_535, 0, 3, 3, 4, 5000, 0):
        decoder.receive(reading(counter), 0)
    assert decoder.health == DecoderHealth(good=7, lost=2 + 4995, duplicates=1, restarts=1)


CAPTURE = bytes.fromhex(
    "AA 07 08 10 23 61 00 00 FF 05 00 26 FE 52 00 5E FC 64 00 06 05 8B AA 07 08 10 23 6B 00 00 FF 05 00 26 FE 52 00 5E"
    "FC 64 00 06 05 95 AA 07 08 10 23 75 00 00 FF 05 00 26 FE 53 00 5F FC 63 00 05 05 9F AA 07 08 10 23 7F 00 00 FF 05"
    "00 26 FE 53 00 60 FC 64 00 06 05 AC AA 01 5E 0E 00 C8 00 C8 00 C8 27 10 27 10 19 64 00 C8 05 22 AA 01 C2 0E 20 48"
    "20 1E 05 F8 2B FB 2A 44 24 64 06 78 05 B8 AA 07 08 10 23 89 00 00 FF 05 00 25 FE 53 00 5F FC 63 00 05 05 B2"
)
"""From the capture of a HEX at 100 Hz in shadow-robot/optoforce#31, without its torn frames."""


def test_a_captured_hex_at_100_hz_loses_nothing_though_its_counter_rises_by_ten() -> None:
    decoder = optoforce.Decoder()
    samples = decoder.receive(CAPTURE, 0)
    assert samples[0].force_n.tolist() == [-251, 38, -430]
    assert samples[0].torque_nm.tolist() == [94, -924, 6]
    assert decoder.health.note == (
        "the sensor seems to have 41.32, 41.11, 7.64 counts/N and 1126, 1082, 1433 counts/N·m: compare counts_per_n,"
        " counts_per_nm"
    )
    decoder.receive(reading(0x2389 + 30), 0)
    decoder.health.note = ""
    assert decoder.health == DecoderHealth(good=6, lost=2)
    scaled = optoforce.Decoder(counts_per_n=[41.3, -41.1, 8.3], counts_per_nm=[1126, 1082, 1433])
    scaled.receive(CAPTURE, 0)
    assert scaled.health == DecoderHealth(good=5)
    scaled.forget()
    scaled.receive(CAPTURE[-42:], 0)  # counts without the nominal loads
    assert scaled.health.note == ""


@pytest.mark.parametrize("step", [1, 3, 10, 33, 100])
def test_D3_losses_are_counted_in_frames_whatever_the_step_of_the_counter(step: int) -> None:
    decoder = optoforce.Decoder()
    for frame in [*range(700), *range(703, 1400), 1399, *range(1400, 1410)]:
        decoder.receive(reading(frame * step % 65_536), 0)
    assert decoder.health == DecoderHealth(good=1407, lost=3, duplicates=1)


def test_D3_another_rate_changes_the_step_at_the_cost_of_a_reading() -> None:
    decoder = optoforce.Decoder()
    for counter in [*range(0, 200, 10), *range(191, 300)]:
        decoder.receive(reading(counter), 0)
    assert (decoder.health.good, decoder.health.duplicates) == (128, 1)


def test_a_sensitivity_report_is_unsigned() -> None:
    nominal, counts = bytes.fromhex("00C8 00C8 00C8 2710 2710 2710 00C8"), bytes.fromhex("9C40" * 7)
    assert frames.parse_report(nominal, counts) == [200.0] * 3 + [4000.0] * 3
    assert frames.parse_report(bytes(14), counts) == [0.0] * 6, "no load is stated"


def test_an_untrusted_counter_is_not_used() -> None:
    decoder = optoforce.Decoder(counted=False)
    decoder.forget()
    for counter in (10, 20, 20, 30):
        decoder.receive(reading(counter), 0)
    assert decoder.health == DecoderHealth(good=4)


def test_the_published_frames_and_requests_are_written() -> None:
    assert sim.encode_reading((-9, -5, 7), 11626) == PUBLISHED
    assert sim.encode_reading((250, -125, 3000, 40, -40, 7), 1000, 0x80) == SIX_AXES
    assert optoforce.Session(period_ms=10, filter_hz=15).start(0) == bytes.fromhex("AA 00 32 03 0A 04 00 00 ED")
    assert frames.encode_frame(b"\xab\x00\x12\x08", b"") == frames.GET_SERIAL_NUMBER
    assert frames.encode_frame(frames.ACK, b"\0") == ACK


def test_a_serial_daq_is_configured_and_asked_for_its_serial_number() -> None:
    session = optoforce.Session()
    assert session.start(0) == bytes.fromhex("AA 00 32 03 01 02 00 00 E2")
    assert len(session.receive(reading(1), 1)) == 1
    session.receive(SERIAL, 1)  # not requested yet
    assert (session.state, session.identity) == ("waiting", "")
    session.receive(ACK[:3], 2)
    session.receive(ACK[3:], 2)
    assert (session.state, session.next_deadline()) == ("configuring", 2)
    assert session.on_time(2) == frames.GET_SERIAL_NUMBER
    session.receive(reading(2) + SERIAL + reading(3), 3)
    assert (session.state, session.identity) == ("running", "S/N ISE12")


@pytest.mark.parametrize("body", [b"\0" * 8, b"\xff12345\xff6", b"\x01\x02345678"])
def test_a_serial_number_that_is_not_text_is_empty(body: bytes) -> None:
    session = optoforce.Session()
    session.start(0)
    session.receive(ACK, 1)
    session.on_time(1)
    session.receive(frames.encode_frame(frames.SERIAL_NUMBER, body), 2)
    assert session.identity == ""


def test_a_refused_configuration_is_named_and_repeated() -> None:
    session = optoforce.Session()
    configuration = session.start(0)
    session.receive(frames.encode_frame(frames.ACK, b"\x03"), 1)
    assert session.state == "refused configuration: code 3"
    assert session.on_time(1 + RETRY_PAUSE_NS) == configuration


def test_a_new_link_forgets_the_old_identity_and_numbers() -> None:
    session = optoforce.Session()
    session.start(0)
    session.receive(ACK, 1)
    session.on_time(1)
    session.receive(SERIAL + reading(700), 2)
    session.start(5)
    session.receive(reading(3), 6)
    assert session.identity == ""
    assert session.health == DecoderHealth(good=2)


def test_requests_are_read_from_any_split_and_after_noise() -> None:
    wanted = frames.Configuration(10, 4)
    damaged = bytearray(frames.encode_configuration(wanted))
    damaged[5] ^= 1
    stream = b"\xab\xaa" + frames.encode_configuration(wanted) + bytes(damaged) + frames.GET_SERIAL_NUMBER
    stream += frames.encode_configuration(wanted)
    received, asked = b"", []
    for byte in stream:
        found, received = sim.parse_requests(received + bytes((byte,)))
        asked += found
    assert asked == [wanted, None, wanted]
    assert sim.parse_requests(stream)[0] == asked
