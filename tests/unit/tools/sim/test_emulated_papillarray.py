from __future__ import annotations

import numpy as np
import pytest
from driving import drive

from slipd.devices import papillarray
from slipd.devices.papillarray import RATES_HZ
from slipd.tools.sim.emulated_papillarray import POWER_ON_HZ, make

MS = 1_000_000


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_the_daemons_session_sets_its_rate(rate_hz: int) -> None:
    emulator = make(1)
    session = papillarray.Session(rate_hz)
    samples = drive(session, emulator, 1.0)
    assert session.state == "running"
    assert len(samples) == pytest.approx(2 * rate_hz, abs=2)
    assert samples[2].device_time_ns - samples[0].device_time_ns == pytest.approx(1e9 / rate_hz, abs=1500)
    assert (session.health.bad, session.health.lost) == (0, 0)


def test_both_sensors_feel_what_acts_on_each_pillar() -> None:
    emulator = make(1)
    forces_n = np.arange(27.0).reshape(9, 3) / 10
    emulator.press(forces_n)
    samples = drive(papillarray.Session(), emulator, 0.5)
    assert {sample.source for sample in samples} == {"0", "1"}
    assert np.mean([sample.values for sample in samples], axis=0) == pytest.approx(forces_n, abs=0.002)


def test_it_streams_from_power_on_and_obeys_only_its_own_rates() -> None:
    emulator = make(1)
    for command in (b"f333\n", b"x", b"f10", b"g100\n"):
        assert emulator.receive(command, 0) == []
    assert len(emulator.advance(100 * MS)) == POWER_ON_HZ / 10
    for byte in b"f100\n":
        emulator.receive(bytes((byte,)), 100 * MS)
    assert len(emulator.advance(200 * MS)) == 10
