"""Test the DynPick decoder with a worked reply, its limits, and the polling of the session."""

from __future__ import annotations

import random

import pytest
from slipd_dynpick import REPLY_TIMEOUT_NS, Decoder, Session, emulator, encode_reply

WORKED = b"0213420001F00200020002000\r\n"


def test_a_worked_reply_is_read_and_a_count_at_the_end_of_its_range_is_an_overload() -> None:
    assert encode_reply((0x2134, 0x2000, 0x1F00, 0x2000, 0x2000, 0x2000)) == WORKED
    sample, beyond = Decoder().receive(WORKED + encode_reply((0x3FFF, *[0x2000] * 5)), 7)
    assert (sample.t_ns, sample.device_time_ns, sample.status, beyond.status) == (7, None, (), ("overload",))
    assert [*sample.force_n, *sample.torque_nm] == pytest.approx((9.4003, 0.0, -7.8132, 0.0, 0.0, 0.0), abs=1e-4)


@pytest.mark.parametrize("size", [1, 5, 27, 1000])
@pytest.mark.parametrize(
    ("stream", "good", "bad", "bad_bytes"),
    [
        (WORKED + b"\x00\xff" + 2 * WORKED + b"02134" + WORKED, 4, 2, 7),
        (random.Random(1).randbytes(10_000) + WORKED, 1, 370, 10_000),
    ],
)
def test_every_split_gives_the_same_and_what_is_no_reply_is_counted(
    stream: bytes, size: int, good: int, bad: int, bad_bytes: int
) -> None:
    decoder = Decoder()
    found = [decoder.receive(stream[at : at + size], 0) for at in range(0, len(stream), size)]
    health = decoder.health
    assert (sum(map(len, found)), health.good, health.bad, health.bad_bytes) == (good, good, bad, bad_bytes)


@pytest.mark.parametrize("wrong", [(1.0,), (1.0, 1.0, 1.0, 1.0, 1.0, 0.0)])
def test_wrong_sensitivities_are_refused(wrong: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="six positive numbers"):
        Decoder(wrong)


def test_one_poll_is_outstanding_a_lost_one_is_repeated_and_a_cut_reply_is_not_completed_after_a_restart() -> None:
    session = Session()
    assert (session.next_deadline(), session.receive(WORKED[:13], 0), session.start(0)) == (None, [], b"R")
    assert (session.receive(WORKED[13:], 1), session.on_time(REPLY_TIMEOUT_NS - 1)) == ([], b"")
    assert session.on_time(REPLY_TIMEOUT_NS) == b"R"
    assert len(session.receive(WORKED, REPLY_TIMEOUT_NS + 1)) == 1
    assert (session.state, session.next_deadline()) == ("running", REPLY_TIMEOUT_NS + 1)
    assert (session.on_time(REPLY_TIMEOUT_NS + 1), session.stop()) == (b"R", b"")
    assert (session.state, session.next_deadline()) == ("closed", None)
    assert len(session.receive(WORKED, 0)) == 1
    assert session.on_time(10 * REPLY_TIMEOUT_NS) == b""


def test_the_emulator_is_read_without_a_bad_byte() -> None:
    sensor, session = emulator.make(seed=1), Session()
    sensor.feel((0.0, 0.0, -5.0), (0.0, 0.0, 0.0))
    (reply,) = sensor.receive(session.start(0), 0)
    (sample,) = session.receive(reply, 0)
    assert (sample.force_n[2], session.health.bad_bytes) == (pytest.approx(-5.0, abs=0.2), 0)
