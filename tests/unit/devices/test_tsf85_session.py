"""The TSF-85 session with a sensor that answers, does not answer, and falls silent."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slipd.devices import tsf85
from slipd.devices.shared.sensor_session import ANSWER_NS, SILENCE_NS
from slipd.devices.tsf85 import encode_block, encode_packet

MS = 1_000_000
STOP, ASK = encode_packet(tsf85.AUTOSEND, b"\0"), encode_packet(tsf85.VERSION)
IMAGE = encode_packet(tsf85.AUTOSEND, encode_block(tsf85.STATIC, 0, np.arange(28)))


def due(session: tsf85.Session) -> bytes:
    """Return what the session sends at its next deadline."""
    at_ns = session.next_deadline()
    assert at_ns is not None
    return session.on_time(at_ns)


def test_the_sensor_is_stopped_queried_and_started() -> None:
    session = tsf85.Session(period_ms=2)
    assert (session.start(0), session.state, session.identity) == (STOP, "waiting", "")
    assert due(session) == ASK
    session.receive(encode_packet(tsf85.VERSION, b"1.1.8"), 25 * MS)
    assert (session.identity, session.next_deadline()) == ("1.1.8", 25 * MS)
    assert session.on_time(25 * MS) == b"\x9a\0\x58\x01\x02"
    assert len(session.receive(IMAGE, 30 * MS)) == 1
    assert (session.state, session.next_deadline()) == ("running", 30 * MS + SILENCE_NS)


def test_a_sensor_that_does_not_report_its_firmware_is_started_nevertheless() -> None:
    session = tsf85.Session()
    session.start(0)
    assert [due(session) for _ in range(3)] == [ASK] * 3
    assert len(session.receive(IMAGE, 3 * ANSWER_NS)) == 1
    assert due(session) == b"\x9a\0\x58\x01\x01"
    session.receive(IMAGE, 4 * ANSWER_NS)
    assert (session.state, session.identity) == ("running", "")


def test_images_are_returned_in_every_state() -> None:
    session = tsf85.Session()
    assert len(session.receive(IMAGE, 0)) == 1
    session.start(0)
    assert len(session.receive(IMAGE, 1)) == 1
    assert session.health.good == 2


def test_silence_restarts_the_sensor_forever_and_never_starts_the_bootloader() -> None:
    session = tsf85.Session()
    written = [session.start(0), *(due(session) for _ in range(60))]
    assert session.state == "no answer to start"
    assert written.count(STOP) > 10
    assert {data[2] for data in written if data} == {tsf85.AUTOSEND, tsf85.VERSION}


def test_stop_stops_the_sensor_and_a_new_start_forgets_the_firmware() -> None:
    session = tsf85.Session()
    session.start(0)
    session.receive(encode_packet(tsf85.VERSION, b"1.1.8"), 0)
    assert (session.stop(), session.state, session.next_deadline()) == (STOP, "closed", None)
    session.start(5)
    assert session.identity == ""


@pytest.mark.parametrize("period_ms", [0, 256, 1.5])
def test_a_period_that_cannot_be_sent_is_refused(period_ms: Any) -> None:
    with pytest.raises(ValueError, match="from 1 to 255, got"):
        tsf85.Session(period_ms=period_ms)
