"""Calibration of a Net F/T: the numbers of a config, the answer over TCP, and the sensor's web page."""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import replace
from typing import Any

import pytest

from slipd.devices.netft.netft_calibration import TCP_INQUIRY, XML_INQUIRY, Calibration, from_counts, read_tcp, read_xml
from slipd.tools.sim.emulated_rdt import encode_tcp, encode_xml

WORKED = bytes.fromhex("12 34 02 03 00 0F 42 40 00 0F 42 40 3D 09 3D 09 3D 09 03 E8 03 E8 03 E8")
TAGS = {"cfgcalsn": "FT27462", "scfgfu": "N", "scfgtu": "Nm", "cfgcpf": 1000, "cfgcpt": 10, "runrate": 7000}
KNOWN = Calibration(1e-3, 0.1, "S/N FT27462", 7000.0)

NEWTONS = {"lbf": 4.4482216, "N": 1, "klbf": 4448.2216, "kN": 1000, "kgf": 9.80665, "gf": 0.00980665}
NEWTON_METRES = {
    "lbf-in": 0.11298483,
    "lbf-ft": 1.3558179,
    "N-m": 1,
    "N-mm": 0.001,
    "kgf-cm": 0.0980665,
    "kN-m": 1000,
}


def test_the_worked_request_is_written() -> None:
    assert TCP_INQUIRY.request == bytes.fromhex("01" + 19 * "00")
    assert TCP_INQUIRY.reply_bytes == len(WORKED)


def test_every_unit_is_converted_by_its_code_and_by_its_name_however_it_is_spelled() -> None:
    forces = {name: name for name in NEWTONS} | {"g": "gf", "KLB": "klbf", "lb": "lbf"}
    torques = {name: name for name in NEWTON_METRES} | {"Nm": "N-m", "lb-in": "lbf-in", "KN-m": "kN-m"}
    for force, torque in itertools.product(forces, torques):
        found = from_counts(10, 100, force, torque)
        assert found.force_n == pytest.approx(NEWTONS[forces[force]] / 10), force
        assert found.torque_nm == pytest.approx(NEWTON_METRES[torques[torque]] / 100), torque
    for code, (force, torque) in enumerate(zip(NEWTONS, NEWTON_METRES, strict=True), start=1):
        assert read_tcp(encode_tcp(10, 100, code, code)) == from_counts(10, 100, force, torque)


@pytest.mark.parametrize(
    ("numbers", "wrong"),
    [
        *(((counts, 1, "N", "N-m"), "counts_per_force must be") for counts in (0, -1, math.nan, math.inf)),
        *(((1, counts, "N", "N-m"), "counts_per_torque must be") for counts in (0, -1, math.nan, math.inf)),
        ((1, 1, "stone", "N-m"), r"force_unit must be one of lbf, N, klbf.* got 'stone'"),
        ((1, 1, "N", "N"), r"torque_unit must be one of lbf-in.* got 'N'"),
        ((1, 1, 5, "N-m"), r"force_unit must be one of lbf.* got 5"),
    ],
)
def test_numbers_and_units_that_cannot_be_are_refused(numbers: tuple[Any, ...], wrong: str) -> None:
    with pytest.raises(ValueError, match=wrong):
        from_counts(*numbers)


@pytest.mark.parametrize(
    ("answer", "wanted"),
    [
        (WORKED, Calibration(1e-6, 1e-6)),
        *((WORKED[:size], None) for size in range(24)),
        (b"\x12\x35", "not an answer"),
        (WORKED + b"\0", "not an answer"),
        (encode_tcp(1, 1, 0, 3), "got 0 and 3"),
        (encode_tcp(1, 1, 2, 7), "got 2 and 7"),
        (encode_tcp(0, 1), "counts_per_force must be a number from 1 to 1e+12, got 0"),
        (encode_tcp(1, 0), "counts_per_torque must be a number from 1 to 1e+12, got 0"),
    ],
)
def test_an_answer_over_tcp_is_read_awaited_or_explained(answer: bytes, wanted: Calibration | str | None) -> None:
    found = read_tcp(answer)
    assert wanted in found if isinstance(wanted, str) and isinstance(found, str) else found == wanted


def page(**changed: Any) -> bytes:
    """Return the web page with changed tags; None removes one."""
    return encode_xml({name: text for name, text in (TAGS | changed).items() if text is not None})


@pytest.mark.parametrize(
    ("answer", "wanted"),
    [
        (page(), KNOWN),
        (page()[:-1], KNOWN),
        *((page()[:size], None) for size in range(len(page()) - len("</netft>\n") + 1)),
        (page(cfgcalsn="\u00e9<b>"), replace(KNOWN, identity="")),
        (page(cfgcalsn=None, runrate=None), Calibration(1e-3, 0.1)),
        *((page(runrate=f), replace(KNOWN, internal_hz=None)) for f in ("nan", "inf", "-5", "0.5", "1e300", "0", "?")),
        (b"SSH-2.0", "not an HTTP answer"),
        (b"HTTP/1.0 404 Not Found\r\n\r\n<html>", "HTTP 404"),
        (b"HTTP/1.0 200 OK\r\n\r\n" + bytes(70_000), "not an HTTP answer"),
        (page(cfgcpf="many"), "could not convert"),
        (page(cfgcpf="nan"), "counts_per_force must be a number from 1 to 1e+12, got nan"),
        (page(cfgcpt="1e300"), "counts_per_torque must be a number from 1 to 1e+12, got 1e+300"),
        (page(scfgfu="stone"), "got 'stone'"),
        (page(cfgcpt=None), "has no cfgcpt"),
        (encode_xml({}), "has no cfgcpf"),
    ],
)
def test_N1_the_web_page_is_read_awaited_or_explained(answer: bytes, wanted: Calibration | str | None) -> None:
    found = read_xml(answer)
    assert wanted in found if isinstance(wanted, str) and isinstance(found, str) else found == wanted


def test_no_answer_raises() -> None:
    rng = random.Random(3)
    for _ in range(3000):
        hit = bytearray(rng.choice((WORKED, page())))
        for _ in range(rng.randrange(1, 6)):
            hit[rng.randrange(len(hit))] = rng.randrange(256)
        read_tcp(bytes(hit))
        read_xml(bytes(hit))


def test_a_complete_answer_is_checked_before_the_stream_is_opened() -> None:
    early = "the answer ends too early"
    answers = WORKED, WORKED[:20], encode_tcp(0, 1)
    wrong = "counts_per_force must be a number from 1 to 1e+12, got 0"
    assert [TCP_INQUIRY.check(answer) for answer in answers] == ["", early, wrong]
    answers = page(), page()[:200], b"HTTP/1.0 503 busy\r\n\r\n"
    assert [XML_INQUIRY.check(answer) for answer in answers] == ["", early, "the sensor's page answers with HTTP 503"]
