"""Net F/T decoder and session: worked records, every status bit, and every source of the calibration."""

from __future__ import annotations

import re
from typing import Any

import pytest

from slipd.devices import netft
from slipd.devices.netft import netft_calibration
from slipd.devices.shared import rdt_records as rdt
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.sensor_session import RETRY_PAUSE_NS
from slipd.tools.sim import emulated_netft as sim
from slipd.types.samples import UNTRUSTED

WORKED = bytes.fromhex(
    "00 00 00 07 00 01 E2 40 00 00 00 00 00 BC 61 4E FF D9 DA 60 05 D8 E3 20 00 02 49 F0 FF FF 5B F0 00 00 00 07"
)
NEXT = bytes.fromhex(
    "00 00 00 08 00 01 E2 47 80 00 00 05 00 BC 61 4E FF D9 DA 60 05 D8 E3 20 00 02 49 F0 FF FF 5B F0 00 00 00 07"
)
COUNTS = (12_345_678, -2_500_000, 98_100_000, 150_000, -42_000, 7)
ANSWER = sim.encode_tcp(1000, 10)
PAGE = sim.encode_xml({"cfgcalsn": "FT1", "scfgfu": "N", "scfgtu": "Nm", "cfgcpf": 1000, "cfgcpt": 10, "runrate": 3500})
START_BUFFERED = bytes.fromhex("12 34 00 03 00 00 00 00")


def record(number: int, status: int = 0) -> bytes:
    return rdt.encode_record(COUNTS, number, 7 * number, status)


def test_the_worked_record_is_written() -> None:
    assert rdt.encode_record(COUNTS, 7, 123_456) == WORKED


def test_units_and_counts_are_options() -> None:
    (sample,) = netft.Decoder(1000, 10, "lbf", "N-mm").receive(record(1), 0)
    assert sample.force_n == pytest.approx([12_345.678 * 4.4482216152605, -2500 * 4.4482216152605, 98100 * 4.44822162])
    assert sample.torque_nm == pytest.approx([15, -4.2, 0.0007])


def test_a_sensor_without_a_known_rate_has_no_time() -> None:
    (sample,) = netft.Decoder(internal_hz=0).receive(record(1), 0)
    assert sample.device_time_ns is None


def test_the_time_goes_on_where_the_counter_wraps() -> None:
    top = 1 << 32
    decoder = netft.Decoder(internal_hz=1000)
    stream = b"".join(rdt.encode_record(COUNTS, number, top - 3 + number) for number in range(1, 6))
    assert [s.device_time_ns - top * 10**6 for s in decoder.receive(stream, 0)] == [
        step * 10**6 for step in range(-2, 3)
    ]


BITS = {
    0: ("temperature",),
    1: ("supply",),
    2: ("broken_gauge", "invalid"),
    3: ("busy",),
    5: ("other_error", "invalid"),
    7: ("no_calibration", "invalid"),
    16: ("monitor",),
    27: ("gauge_range", "overload"),
    28: ("simulated",),
    29: ("calibration_checksum", "invalid"),
    30: ("overload",),
    31: ("error", "invalid"),
}


def test_F2_every_status_bit_has_its_words() -> None:
    for bit in range(32):
        stream = b"".join(record(number, 1 << bit) for number in range(1, 5))
        assert netft.Decoder().receive(stream, 0)[-1].status == BITS.get(bit, ("unknown",))


def test_F2_an_error_that_no_known_bit_explains_is_invalid() -> None:
    decoder = netft.Decoder()
    words = [decoder.receive(record(n, s), 0)[0].status for n, s in ((1, 1 << 31), (2, 1 << 31 | 1), (3, 1 << 31 | 8))]
    assert words == [("error", "invalid"), ("temperature", "error"), ("busy", "error", "invalid")]


EXPLAINED = {0, 1, 27, 30}
"""Bits that say by themselves what the error bit stands for, and whether the reading is lost."""


def test_F2_the_error_bit_makes_a_reading_invalid_unless_another_bit_explains_it() -> None:
    """Bits: Axia manual, table 4.7; on a classic box the reserved ones stand for faults of boards, links and memory."""
    for bit in sorted({*range(31)} - {16}):
        stream = b"".join(record(number, 1 << 31 | 1 << bit) for number in range(1, 5))
        status = netft.Decoder().receive(stream, 0)[-1].status
        words = {*BITS.get(bit, ("unknown",)), "error"} | ({"invalid"} if bit not in EXPLAINED else set())
        assert set(status) == words


@pytest.mark.parametrize(
    ("status", "trusted"), [(0x80010000, True), (0x00010000, True), (0x80020000, False), (0x80030000, False)]
)
def test_F2_a_latched_monitor_condition_of_a_classic_box_is_a_warning(status: int, trusted: bool) -> None:
    """The first and third status, with their severity, are those that the tests of pyNetFT pass to classify_status."""
    decoder = netft.Decoder()
    sample = decoder.receive(b"".join(record(number, status) for number in range(1, 5)), 0)[-1]
    assert UNTRUSTED.isdisjoint(sample.status) == trusted
    assert (decoder.health.warning == netft.MONITOR) == bool(status & 0x10000)
    decoder.receive(b"".join(record(number) for number in range(5, 9)), 1)
    assert decoder.health.warning == ""


def test_F2_all_bits_at_once_name_each_word_once() -> None:
    status = netft.Decoder().receive(b"".join(record(n, 0xFFFF_FFFF) for n in range(1, 5)), 0)[0].status
    assert sorted(status) == sorted({word for words in BITS.values() for word in words} | {"unknown"})


def test_N3_a_count_at_the_end_of_its_range_is_overload() -> None:
    (sample,) = netft.Decoder().receive(rdt.encode_record((*COUNTS[:5], -(1 << 31)), 1, 1), 0)
    assert sample.status == ("overload",)


def test_D3_gap_duplicate_and_restart_are_distinguished() -> None:
    decoder = netft.Decoder()
    for number in (1, 2, 5, 6, 6, 7, 8, 1, 2):
        decoder.receive(record(number), 0)
    assert decoder.health == DecoderHealth(good=8, lost=2, duplicates=1, restarts=1)


def test_F2_a_gauge_out_of_range_explains_the_error_bit() -> None:
    (sample,) = netft.Decoder().receive(record(1, 1 << 31 | 1 << 27), 0)
    assert sample.status == ("gauge_range", "overload", "error")


def test_the_inquiry_follows_the_options() -> None:
    assert netft.inquiry(buffered=False) == netft_calibration.TCP_INQUIRY
    assert netft.inquiry(calibration="xml") == netft_calibration.XML_INQUIRY
    assert netft.inquiry(calibration="config") is None


@pytest.mark.parametrize(
    ("reported", "wanted", "request_", "fault"),
    [
        ({"comrdtrate": 100}, 0, b"", ""),
        ({"comrdtrate": 1000}, 1000, b"", ""),
        ({"comrdtrate": 304}, 300, b"", ""),  # 7000 / 23, the next rate above 300 Hz
        ({"comrdtrate": 7000}, 7912, b"", ""),
        ({"comrdtrate": 488, "runrate": 488}, 400, b"", ""),
        (
            {"comrdtrate": 100},
            1000,
            b"GET /comm.cgi?comrdtrate=1000 HTTP/1.0\r\n\r\n",
            "take output_hz = 1000: .* 100 Hz",
        ),
        ({"comrdtrate": "?"}, 1000, b"", "reports no output rate"),
        ({}, 1000, b"", "reports no output rate"),
    ],
)
def test_the_output_rate_is_set_only_where_the_page_reports_another(
    reported: dict[str, Any], wanted: int, request_: bytes, fault: str
) -> None:
    """Request and rounding are those of public clients, see `netft_output_rate`."""
    tags = {"scfgfu": "N", "scfgtu": "Nm", "cfgcpf": 1000, "cfgcpt": 10, "runrate": 7000} | reported
    page = sim.encode_xml(tags)
    asked = netft.inquiry(calibration="xml", output_hz=wanted)
    assert asked is not None
    assert asked.change(page) == request_
    session = started(calibration="xml", output_hz=wanted)
    session.receive(page, 0)
    assert len(session.receive(record(1), 1)) == 1
    assert re.search(fault, session.health.warning) if fault else session.health.warning == ""
    session.receive(record(2, 1 << 16), 2)
    assert session.health.warning == netft.MONITOR


def test_a_page_that_cannot_be_read_changes_nothing() -> None:
    asked = netft.inquiry(calibration="xml", output_hz=1000)
    assert asked is not None
    assert asked.change(b"HTTP/1.0 503 busy\r\n\r\n") == b""


def started(**options: Any) -> netft.Session:
    session = netft.Session(**options)
    session.start(0)
    return session


def test_the_calibration_is_awaited_and_then_records_are_asked_for() -> None:
    session = started()
    assert session.state == "waiting for calibration"
    assert session.receive(ANSWER, 5) == []
    assert (session.state, session.next_deadline()) == ("waiting", 5)
    assert session.on_time(5) == START_BUFFERED
    (sample,) = session.receive(record(1), 6)
    assert sample.force_n[0] == pytest.approx(12_345.678)
    assert sample.torque_nm[0] == pytest.approx(15_000)
    assert (session.state, session.identity) == ("running", "")


@pytest.mark.parametrize("size", [1, 7, 100])
def test_the_page_may_come_in_pieces_and_tells_identity_and_rate(size: int) -> None:
    session = started(calibration="xml", buffered=False)
    for at in range(0, len(PAGE), size):
        assert session.receive(PAGE[at : at + size], 5) == []
    assert session.on_time(5) == rdt.encode_request(rdt.START)
    (sample,) = session.receive(record(1), 6)
    assert sample.device_time_ns == 2_000_000
    assert session.identity == "S/N FT1"


def test_a_sensor_asked_to_have_no_time_has_none_whatever_its_page_says() -> None:
    session = started(calibration="xml", internal_hz=0)
    session.receive(PAGE, 0)
    assert session.receive(record(1), 6)[0].device_time_ns is None


def test_numbers_of_the_config_need_no_answer() -> None:
    session = netft.Session(calibration="config", counts_per_force=1000)
    assert session.start(9) == START_BUFFERED
    assert session.receive(record(1), 10)[0].force_n[0] == pytest.approx(12_345.678)


def test_a_wrong_answer_is_told_and_records_are_counted_but_not_returned() -> None:
    session = started()
    session.receive(sim.encode_tcp(0, 1), 5)
    assert session.state == "wrong calibration: counts_per_force must be a number from 1 to 1e+12, got 0"
    assert session.receive(record(1) + record(2), 6) == []
    assert session.health == DecoderHealth(bad=3, bad_bytes=24)
    due_ns = session.next_deadline()
    assert due_ns == 5 + RETRY_PAUSE_NS
    assert session.on_time(due_ns - 1) == session.on_time(due_ns) == b""
    assert session.state.startswith("wrong calibration")
    assert session.next_deadline() == due_ns + RETRY_PAUSE_NS


def test_a_missing_answer_is_told_and_a_late_one_is_taken() -> None:
    session = started()
    assert session.on_time(RETRY_PAUSE_NS) == b""
    assert session.state == "no calibration"
    session.receive(ANSWER, 3 * RETRY_PAUSE_NS)
    assert session.on_time(3 * RETRY_PAUSE_NS) == START_BUFFERED


def test_another_link_means_another_calibration() -> None:
    session = started()
    session.receive(ANSWER, 0)
    session.on_time(0)
    assert len(session.receive(record(900), 1)) == 1
    session.start(10)
    assert session.state == "waiting for calibration"
    session.receive(sim.encode_tcp(2000, 10), 11)
    session.on_time(11)
    assert session.receive(record(1), 12)[0].force_n[0] == pytest.approx(6172.839)
    assert session.health.restarts == 0


def test_stop_stops_the_sensor_and_what_still_comes_is_returned() -> None:
    session = started()
    assert session.stop() == bytes.fromhex("12 34 00 00 00 00 00 00")
    assert (session.state, session.next_deadline()) == ("closed", None)
    session = started(calibration="config")
    session.stop()
    assert len(session.receive(record(1), 5)) == 1
    assert session.next_deadline() is None
