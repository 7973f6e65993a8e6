"""The emulated Robotous sensor with the session of the daemon."""

from __future__ import annotations

import numpy as np
import pytest
from driving import MS, drive

from slipd.devices import robotous
from slipd.tools.sim import emulated_robotous as sim
from slipd.tools.sim.emulated_robotous import make

FORCE_N, TORQUE_NM = np.array([1.0, -2.0, -8.0]), np.array([0.01, 0.02, -0.03])


def test_a_second_session_writes_nothing_to_its_eeprom() -> None:
    emulator = make(2)
    session = robotous.Session(filter_hz=100)
    drive(session, emulator, 0.1)
    assert emulator.writes == 2
    emulator.receive(session.stop(), 100 * MS)
    assert emulator.advance(150 * MS) == []
    drive(robotous.Session(filter_hz=100), emulator, 0.1, begin_ns=150 * MS)
    assert emulator.writes == 2


@pytest.mark.parametrize(("baud", "hz", "note"), [(115_200, 200, "refused rate"), (921_600, 500, "")])
def test_a_rate_that_its_line_does_not_carry_is_refused_and_it_sends_at_its_own(baud: int, hz: int, note: str) -> None:
    session = robotous.Session(output_hz=500)
    samples = drive(session, make(6, baud=baud), 1.0)
    assert (session.state, session.health.note.partition(":")[0]) == ("running", note)
    assert hz - 20 <= len(samples) <= hz


@pytest.mark.parametrize(("number", "arguments"), [(robotous.SET_RATE, b"\x63"), (robotous.SET_FILTER, b"\x01\x63")])
def test_what_it_cannot_do_is_refused(number: int, arguments: bytes) -> None:
    emulator = make(4)
    (answer,) = emulator.receive(robotous.encode_command(number, arguments), 0)
    assert answer == sim.encode_response(number, b"\0\x02")
    assert emulator.writes == 0
