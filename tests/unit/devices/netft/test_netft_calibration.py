"""Calibration of a Net F/T: the numbers of a config, the answer over TCP, and the sensor's web page."""

from __future__ import annotations

import itertools
import math
import random

import pytest

from slipd.devices import Inquiry
from slipd.devices.netft import netft_calibration
from slipd.devices.netft.netft_calibration import TCP_INQUIRY, XML_INQUIRY, Calibration, from_counts, read_tcp, read_xml
from slipd.tools.sim.emulated_netft import encode_tcp, encode_xml

WORKED = bytes.fromhex("12 34 02 03 00 0F 42 40 00 0F 42 40 3D 09 3D 09 3D 09 03 E8 03 E8 03 E8")
PAGE = {"cfgcalsn": "FT27462", "scfgfu": "N", "scfgtu": "Nm", "cfgcpf": 1000, "cfgcpt": 10, "runrate": 7000}

NEWTONS = {"lbf": 4.4482216, "N": 1, "klbf": 4448.2216, "kN": 1000, "kgf": 9.80665, "gf": 0.00980665}
NEWTON_METRES = {
    "lbf-in": 0.11298483,
    "lbf-ft": 1.3558179,
    "N-m": 1,
    "N-mm": 0.001,
    "kgf-cm": 0.0980665,
    "kN-m": 1000,
}


def test_the_worked_answer_is_read() -> None:
    assert read_tcp(WORKED) == Calibration(1e-6, 1e-6)
    assert netft_calibration.TCP_INQUIRY.request == bytes.fromhex("01" + 19 * "00")
    assert netft_calibration.TCP_INQUIRY.reply_bytes == len(WORKED)


@pytest.mark.parametrize("code", range(1, 7))
def test_every_unit_code_is_converted(code: int) -> None:
    found = read_tcp(encode_tcp(100, 1000, code, code))
    assert isinstance(found, Calibration)
    assert found.force_n == pytest.approx(list(NEWTONS.values())[code - 1] / 100)
    assert found.torque_nm == pytest.approx(list(NEWTON_METRES.values())[code - 1] / 1000)


def test_every_unit_name_is_converted_however_it_is_spelled() -> None:
    forces = {name: name for name in NEWTONS} | {"g": "gf", "KLB": "klbf", "lb": "lbf"}
    torques = {name: name for name in NEWTON_METRES} | {"Nm": "N-m", "lb-in": "lbf-in", "KN-m": "kN-m"}
    for force, torque in itertools.product(forces, torques):
        found = from_counts(10, 10, force, torque)
        assert found.force_n == pytest.approx(NEWTONS[forces[force]] / 10), force
        assert found.torque_nm == pytest.approx(NEWTON_METRES[torques[torque]] / 10), torque


@pytest.mark.parametrize("counts", [0, -1, math.nan, math.inf])
def test_impossible_counts_per_unit_are_refused(counts: float) -> None:
    with pytest.raises(ValueError, match="counts_per_force"):
        from_counts(counts, 1, "N", "N-m")
    with pytest.raises(ValueError, match="counts_per_torque"):
        from_counts(1, counts, "N", "N-m")


def test_an_unknown_unit_is_refused_with_a_list_of_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"force_unit must be one of lbf, N, klbf.* got 'stone'"):
        from_counts(1, 1, "stone", "N-m")
    with pytest.raises(ValueError, match=r"torque_unit must be one of lbf-in.* got 'N'"):
        from_counts(1, 1, "N", "N")
    with pytest.raises(ValueError, match=r"force_unit must be one of lbf.* got 5"):
        from_counts(1, 1, 5, "N-m")  # type: ignore[arg-type] # as a config may have it


@pytest.mark.parametrize("size", range(24))
def test_an_incomplete_answer_is_awaited(size: int) -> None:
    assert read_tcp(WORKED[:size]) is None


@pytest.mark.parametrize(
    ("answer", "fault"),
    [
        (b"\x12\x35", "not an answer"),
        (WORKED + b"\0", "not an answer"),
        (encode_tcp(1, 1, 0, 3), "got 0 and 3"),
        (encode_tcp(1, 1, 2, 7), "got 2 and 7"),
        (encode_tcp(0, 1), "counts_per_force must be a number from 1 to 1e+12, got 0"),
        (encode_tcp(1, 0), "counts_per_torque must be a number from 1 to 1e+12, got 0"),
    ],
)
def test_a_wrong_answer_is_explained(answer: bytes, fault: str) -> None:
    found = read_tcp(answer)
    assert isinstance(found, str)
    assert fault in found


def test_the_page_is_read_with_serial_number_and_rate() -> None:
    assert read_xml(encode_xml(PAGE)) == Calibration(1e-3, 0.1, "S/N FT27462", 7000.0)
    assert read_xml(encode_xml({**PAGE, "cfgcalsn": "\u00e9<b>", "runrate": 0})) == Calibration(1e-3, 0.1)
    assert read_xml(encode_xml({name: PAGE[name] for name in ("scfgfu", "scfgtu", "cfgcpf", "cfgcpt")})) == Calibration(
        1e-3, 0.1
    )


def test_a_page_in_pieces_is_awaited() -> None:
    page = encode_xml(PAGE)
    for size in range(len(page) - len("</netft>\n") + 1):
        assert read_xml(page[:size]) is None
    assert read_xml(page[:-1]) is not None


@pytest.mark.parametrize(
    ("answer", "fault"),
    [
        (b"SSH-2.0", "not an HTTP answer"),
        (b"HTTP/1.0 404 Not Found\r\n\r\n<html>", "HTTP 404"),
        (b"HTTP/1.0 200 OK\r\n\r\n" + bytes(70_000), "not an HTTP answer"),
        (encode_xml({**PAGE, "cfgcpf": "many"}), "could not convert"),
        (encode_xml({**PAGE, "cfgcpf": "nan"}), "counts_per_force must be a number from 1 to 1e+12, got nan"),
        (encode_xml({**PAGE, "cfgcpt": "1e300"}), "counts_per_torque must be a number from 1 to 1e+12, got 1e+300"),
        (encode_xml({**PAGE, "scfgfu": "stone"}), "got 'stone'"),
        (encode_xml({"cfgcpf": 1, "scfgfu": "N", "scfgtu": "Nm"}), "has no cfgcpt"),
        (encode_xml({}), "has no cfgcpf"),
    ],
)
def test_a_wrong_page_is_explained(answer: bytes, fault: str) -> None:
    found = read_xml(answer)
    assert isinstance(found, str)
    assert fault in found


def test_N1_a_rate_that_is_not_a_number_is_ignored() -> None:
    for rate in ("nan", "inf", "-5", "1e-300", "0.5", "1e300", "0"):
        found = read_xml(encode_xml({**PAGE, "runrate": rate}))
        assert isinstance(found, Calibration)
        assert found.internal_hz is None


def test_no_answer_raises() -> None:
    rng = random.Random(3)
    page = encode_xml(PAGE)
    for _ in range(3000):
        hit = bytearray(rng.choice((WORKED, page)))
        for _ in range(rng.randrange(1, 6)):
            hit[rng.randrange(len(hit))] = rng.randrange(256)
        read_tcp(bytes(hit))
        read_xml(bytes(hit))


@pytest.mark.parametrize(
    ("inquiry", "answer", "fault"),
    [
        (TCP_INQUIRY, encode_tcp(1_000_000, 1_000_000), ""),
        (TCP_INQUIRY, encode_tcp(1_000_000, 1_000_000)[:20], "the answer ends too early"),
        (TCP_INQUIRY, encode_tcp(0, 1), "counts_per_force must be a number from 1 to 1e+12, got 0"),
        (XML_INQUIRY, encode_xml(PAGE), ""),
        (XML_INQUIRY, encode_xml(PAGE)[:200], "the answer ends too early"),
        (XML_INQUIRY, b"HTTP/1.0 503 busy\r\n\r\n", "the sensor's page answers with HTTP 503"),
    ],
)
def test_a_complete_answer_is_checked_before_the_stream_is_opened(inquiry: Inquiry, answer: bytes, fault: str) -> None:
    assert inquiry.check(answer) == fault
