"""Net F/T decoder and session: every status bit, and every source of the calibration and the output rate."""

from __future__ import annotations

import re
from typing import Any

import pytest
from readings import Case, fields

from slipd.devices import netft
from slipd.devices.netft import netft_calibration
from slipd.devices.shared import rdt_records as rdt
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.tools.sim import emulated_rdt as sim

COUNTS = (12_345_678, -2_500_000, 98_100_000, 150_000, -42_000, 7)
ANSWER = sim.encode_tcp(1000, 10)
TAGS = {"cfgcalsn": "FT1", "scfgfu": "N", "scfgtu": "Nm", "cfgcpf": 1000, "cfgcpt": 10, "runrate": 3500}
START_BUFFERED = bytes.fromhex("12 34 00 03 00 00 00 00")
TOP = 1 << 32


def record(number: int, status: int = 0) -> bytes:
    return sim.encode_record(COUNTS, number, 7 * number, status)


def steady(status: int) -> bytes:
    """Return records that confirm each other, whatever their status."""
    return b"".join(record(number, status) for number in range(1, 5))


BITS = dict.fromkeys(range(32), ("unknown",)) | {
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
EXPLAINED = {0, 1, 2, 5, 7, 27, 29, 30}
"""Bits that say by themselves what the error bit stands for.

Bits: Axia manual, table 4.7; on a classic box the reserved ones stand for faults of boards, links and memory.
"""
CASES = {
    **{
        f"status bit {bit}": Case(
            steady(1 << bit), fields("status", [words] * 4), {"warning": netft.MONITOR} if bit == 16 else {}
        )
        for bit, words in BITS.items()
    },
    **{
        f"status bit {bit} with the error bit": Case(
            steady(1 << 31 | 1 << bit),
            fields("status", [(*BITS[bit], "error", *("invalid",) * (bit not in EXPLAINED))] * 4),
        )
        for bit in sorted({*range(31)} - {16})
    },
    "the words of several bits": Case(
        steady(1 << 31 | 1 << 3 | 1 << 2 | 1 << 30 | 1 << 27 | 1 << 4),
        fields("status", [("broken_gauge", "invalid", "busy", "gauge_range", "overload", "unknown", "error")] * 4),
    ),
    # The first and the third status, with their severity, are those that the tests of pyNetFT pass to classify_status.
    "a latched monitor condition of a classic box is a warning": Case(
        steady(0x80010000), fields("status", [("monitor",)] * 4), {"warning": netft.MONITOR}
    ),
    "another condition of a classic box is invalid": Case(
        steady(0x80020000), fields("status", [("unknown", "error", "invalid")] * 4)
    ),
    "both of them are invalid": Case(
        steady(0x80030000),
        fields("status", [("monitor", "unknown", "error", "invalid")] * 4),
        {"warning": netft.MONITOR},
    ),
    "the warning ends with the condition": Case(steady(0x00010000) + record(5) + record(6), [{}] * 6),
    "a count at the end of its range is overload": Case(
        sim.encode_record((*COUNTS[:5], -(1 << 31)), 1, 1), fields("status", [("overload",)])
    ),
    "gap, duplicate and restart are distinguished": Case(
        b"".join(record(number) for number in (1, 2, 5, 6, 6, 7, 8, 1, 2)),
        [{}] * 8,
        {"lost": 2, "duplicates": 1, "restarts": 1},
    ),
    "units and counts are options": Case(
        record(1),
        [
            {
                "force_n": [12_345.678 * 4.4482216152605, -2500 * 4.4482216152605, 98_100 * 4.4482216152605],
                "torque_nm": [15, -4.2, 0.0007],
            }
        ],
        options={"counts_per_force": 1000, "counts_per_torque": 10, "force_unit": "lbf", "torque_unit": "N-mm"},
    ),
    "a sensor without a known rate has no time": Case(
        record(1), fields("device_time_ns", [None]), options={"internal_hz": 0}
    ),
    "the time goes on where the counter wraps": Case(
        b"".join(sim.encode_record(COUNTS, number, TOP - 3 + number) for number in range(1, 6)),
        fields("device_time_ns", [(TOP + step) * 10**6 for step in range(-2, 3)]),
        options={"internal_hz": 1000},
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_F2_N3_D3_a_stream_gives_these_readings_and_counts(name: str) -> None:
    CASES[name].check(netft.Decoder)


def started(*answers: bytes, **options: Any) -> netft.Session:
    """Return a session on a new link that gets these data at once."""
    session = netft.Session(**options)
    session.start(0)
    for answer in answers:
        assert session.receive(answer, 5) == []
    return session


def test_the_inquiry_follows_the_options() -> None:
    found = [netft.inquiry(buffered=False), *(netft.inquiry(calibration=kind) for kind in ("xml", "config"))]
    assert found == [netft_calibration.TCP_INQUIRY, netft_calibration.XML_INQUIRY, None]


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
    """Request and rounding are those of public clients, see `netft_calibration`."""
    page = sim.encode_xml(TAGS | {"runrate": 7000} | reported)
    asked = netft.inquiry(calibration="xml", output_hz=wanted)
    assert asked is not None
    assert (asked.change(page), asked.change(b"HTTP/1.0 503 busy\r\n\r\n")) == (request_, b"")
    session = started(page, calibration="xml", output_hz=wanted)
    assert len(session.receive(record(1), 6)) == 1
    assert re.search(fault, session.health.warning) if fault else session.health.warning == ""
    session.receive(record(2, 1 << 16), 7)
    assert session.health.warning == netft.MONITOR


def test_the_calibration_is_awaited_and_then_records_are_asked_for() -> None:
    session = started()
    assert (session.state, session.next_deadline()) == ("waiting for calibration", None)
    assert session.receive(ANSWER, 5) == []
    assert (session.state, session.next_deadline(), session.on_time(5)) == ("waiting", 5, START_BUFFERED)
    (sample,) = session.receive(record(900), 6)
    assert (sample.force_n[0], sample.torque_nm[0]) == pytest.approx((12_345.678, 15_000))
    assert (session.state, session.identity) == ("running", "")
    session.start(10)
    assert session.state == "waiting for calibration", "another link means another calibration"
    session.receive(sim.encode_tcp(2000, 10), 11)
    session.on_time(11)
    assert session.receive(record(1), 12)[0].force_n[0] == pytest.approx(6172.839)
    assert session.health.restarts == 0


@pytest.mark.parametrize(("clock", "time_ns"), [({}, 2_000_000), ({"internal_hz": 0}, None)])
def test_the_page_in_pieces_tells_identity_and_rate_unless_no_time_is_wanted(
    clock: dict[str, Any], time_ns: int | None
) -> None:
    page = sim.encode_xml(TAGS)
    pieces = [page[at : at + 7] for at in range(0, len(page), 7)]
    session = started(*pieces, calibration="xml", buffered=False, **clock)
    assert session.on_time(5) == rdt.encode_request(rdt.START)
    assert session.receive(record(1), 6)[0].device_time_ns == time_ns
    assert session.identity == "S/N FT1"


def test_numbers_of_the_config_need_no_answer() -> None:
    session = netft.Session(calibration="config", counts_per_force=1000)
    assert session.start(9) == START_BUFFERED
    assert session.receive(record(1), 10)[0].force_n[0] == pytest.approx(12_345.678)


def test_a_wrong_answer_is_told_and_records_are_counted_but_not_returned() -> None:
    session = started(sim.encode_tcp(0, 1), record(1) + record(2))
    assert session.state == "wrong calibration: counts_per_force must be a number from 1 to 1e+12, got 0"
    assert session.health == DecoderHealth(bad=3, bad_bytes=24)
    assert (session.next_deadline(), session.on_time(1 << 40)) == (None, b"")
