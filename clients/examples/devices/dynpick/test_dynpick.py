"""Test the DynPick decoder with a worked reply, its limits, and the polling of the session."""

from __future__ import annotations

import random

import pytest
from slipd_dynpick import REPLY_TIMEOUT_NS, Decoder, Session, emulator, encode_reply

WORKED = b"0213420001F00200020002000\r\n"


def test_a_worked_reply_is_read() -> None:
    (sample,) = Decoder().receive(WORKED, 7)
    assert sample.force_n == pytest.approx((9.4003, 0.0, -7.8132), abs=1e-4)
    assert sample.torque_nm == pytest.approx((0.0, 0.0, 0.0))
    assert (sample.t_ns, sample.device_time_ns, sample.status) == (7, None, ())
    assert encode_reply((0x2134, 0x2000, 0x1F00, 0x2000, 0x2000, 0x2000)) == WORKED


def test_a_count_at_the_end_of_its_range_is_an_overload() -> None:
    (sample,) = Decoder().receive(encode_reply((0x3FFF, 0x2000, 0x2000, 0x2000, 0x2000, 0x2000)), 0)
    assert sample.status == ("overload",)


def test_every_split_gives_the_same() -> None:
    stream = WORKED + b"\x00\xff" + 2 * WORKED + b"02134" + WORKED
    for size in (1, 5, 27, len(stream)):
        decoder = Decoder()
        pieces = [stream[at : at + size] for at in range(0, len(stream), size)]
        assert len([sample for piece in pieces for sample in decoder.receive(piece, 0)]) == 4
        assert (decoder.health.bad, decoder.health.bad_bytes) == (2, 7)


def test_a_reply_cut_by_an_unplug_is_not_completed_after_the_restart() -> None:
    session = Session()
    session.receive(WORKED[:13], 0)
    session.start(1)
    assert session.receive(WORKED[13:], 2) == []
    assert len(session.receive(WORKED, 3)) == 1


def test_noise_gives_nothing_and_is_counted() -> None:
    decoder = Decoder()
    noise = random.Random(1).randbytes(10_000)
    assert decoder.receive(noise, 0) == []
    assert decoder.receive(WORKED, 0)
    assert (decoder.health.good, decoder.health.bad, decoder.health.bad_bytes) == (1, 1, 10_000)


def test_wrong_sensitivities_are_refused() -> None:
    for wrong in ((1.0,), (1.0, 1.0, 1.0, 1.0, 1.0, 0.0)):
        with pytest.raises(ValueError, match="six positive numbers"):
            Decoder(wrong)


def test_one_poll_is_outstanding_and_a_lost_one_is_repeated() -> None:
    session = Session()
    assert session.next_deadline() is None
    assert session.start(0) == b"R"
    assert session.on_time(REPLY_TIMEOUT_NS - 1) == b""
    assert session.on_time(REPLY_TIMEOUT_NS) == b"R"
    session.receive(WORKED, REPLY_TIMEOUT_NS + 1)
    assert (session.state, session.next_deadline()) == ("running", REPLY_TIMEOUT_NS + 1)
    assert session.on_time(REPLY_TIMEOUT_NS + 1) == b"R"
    assert session.stop() == b""
    assert (session.state, session.next_deadline()) == ("closed", None)
    assert session.receive(WORKED, 0)
    assert session.on_time(10 * REPLY_TIMEOUT_NS) == b""


def test_the_emulator_is_read_without_a_bad_byte() -> None:
    sensor, session = emulator.make(seed=1), Session()
    sensor.feel((0.0, 0.0, -5.0), (0.0, 0.0, 0.0))
    sensor.opened(0)
    (reply,) = sensor.receive(session.start(0), 0)
    (sample,) = session.receive(reply, 0)
    assert sample.force_n[2] == pytest.approx(-5.0, abs=0.2)
    assert session.health.bad_bytes == 0
