"""The emulated OptoForce DAQ and Ethernet converter with the session of the daemon."""

from __future__ import annotations

import numpy as np
import pytest
from driving import MS, drive

from slipd.devices import optoforce
from slipd.devices.optoforce import UDP_PERIOD
from slipd.devices.shared import rdt_records as rdt
from slipd.tools.sim.emulated_optoforce import OptoforceConverter, make

FORCE_N, TORQUE_NM = np.array([1.0, -2.0, -8.0]), np.array([0.01, 0.02, -0.03])


@pytest.mark.parametrize(("emulator", "identity"), [(make(1), "S/N HEXEB123"), (OptoforceConverter(1), "")])
def test_the_daemons_session_gets_1000_readings_a_second(emulator: OptoforceConverter, identity: str) -> None:
    emulator.opened(0)
    emulator.feel(FORCE_N, TORQUE_NM)
    session = optoforce.Session(**emulator.options)
    samples = drive(session, emulator, 1.0)
    assert (session.state, session.identity) == ("running", identity)
    assert 980 <= len(samples) <= 1000
    assert np.mean([s.force_n for s in samples], axis=0) == pytest.approx(FORCE_N, abs=0.01)
    assert np.mean([s.torque_nm for s in samples], axis=0) == pytest.approx(TORQUE_NM, abs=2e-4)
    assert session.health.lost == session.health.bad == 0


@pytest.mark.parametrize("emulator", [make(2), OptoforceConverter(2)])
def test_stopped_it_is_silent_and_a_start_wakes_it(emulator: OptoforceConverter) -> None:
    session = optoforce.Session(**emulator.options, period_ms=10)
    assert 8 <= len(drive(session, emulator, 0.1)) <= 20
    emulator.receive(session.stop(), 100 * MS)
    assert emulator.advance(200 * MS) == []
    assert len(drive(session, emulator, 0.1, begin_ns=200 * MS)) >= 8


def test_a_daq_sends_from_power_on() -> None:
    emulator = make(3)
    emulator.status = 1 << 4
    decoder = optoforce.Decoder(**emulator.options)
    samples = [sample for frame in emulator.advance(100 * MS) for sample in decoder.receive(frame, 0)]
    assert [sample.status for sample in samples] == [("overload",)] * 10


def test_a_converter_waits_for_its_start_and_knows_no_other_datagram() -> None:
    emulator = OptoforceConverter(4)
    emulator.status = 1 << 12
    for datagram in (b"noise", rdt.encode_request(UDP_PERIOD, 0), rdt.encode_request(0x42, 255)):
        assert emulator.receive(datagram, 0) == []
    assert emulator.advance(100 * MS) == []
    emulator.receive(rdt.encode_request(rdt.START), 100 * MS)
    decoder = optoforce.Decoder(**emulator.options)
    samples = [sample for record in emulator.advance(200 * MS) for sample in decoder.receive(record, 0)]
    assert [sample.device_time_ns for sample in samples] == [(100 + 10 * step) * MS for step in range(1, 11)]
    assert samples[0].status == ("temperature",)
