from __future__ import annotations

import numpy as np
import pytest
from driving import drive

from slipd.devices.bota import Session as BotaSession
from slipd.devices.optoforce import Session as OptoforceSession
from slipd.devices.pvdf import Decoder as PvdfDecoder
from slipd.devices.robotiq_2f import Session as GripperSession
from slipd.tools.sim.emulators import make_emulator

MS = 1_000_000


def test_a_bota_sensor_measures_in_its_own_frame() -> None:
    emulator = make_emulator("bota", 3)
    emulator.opened(0)
    emulator.feel(np.array((1.0, -2.0, 30.0)), np.array((0.1, 0.2, -0.3)))
    samples = drive(BotaSession(**emulator.options), emulator, 2.0)
    forces = np.array([sample.force_n for sample in samples])
    assert forces.mean(axis=0) == pytest.approx((1.0, -2.0, 30.0), abs=0.01)
    assert np.mean([sample.torque_nm for sample in samples], axis=0) == pytest.approx((0.1, 0.2, -0.3), abs=0.001)
    assert len(samples) > emulator.rate_hz


def test_a_pvdf_pad_sends_the_given_charges() -> None:
    emulator = make_emulator("pvdf", 3)
    charges = np.arange(128) * 10.0
    emulator.press(charges)
    decoder = PvdfDecoder(**emulator.options)
    samples = [s for t in range(0, 2000 * MS, MS) for data in emulator.advance(t) for s in decoder.receive(data, t)]
    assert len(samples) == pytest.approx(2 * emulator.rate_hz, abs=1)
    assert np.mean([sample.values for sample in samples], axis=0) == pytest.approx(charges, abs=1.0)
    assert samples[1].device_time_ns - samples[0].device_time_ns == pytest.approx(1e9 / emulator.rate_hz, rel=1e-3)


def test_a_gripper_with_nothing_between_its_pads_answers_when_it_is_asked() -> None:
    emulator = make_emulator("robotiq_2f")
    assert emulator.advance(10**9) == []
    samples = drive(GripperSession(**emulator.options), emulator, 2.0)
    assert len(samples) == pytest.approx(2 * emulator.rate_hz, abs=3)
    assert {sample.object for sample in samples} == {"none"}


def test_an_optoforce_sensor_speaks_as_its_line_asks() -> None:
    for wiring in ("serial", "udp"):
        emulator = make_emulator("optoforce", 3, wiring=wiring)
        session = OptoforceSession(**(emulator.options | {"wiring": wiring}))
        assert len(drive(session, emulator, 2.0)) > emulator.rate_hz


@pytest.mark.parametrize("seed", [1, 2])
def test_noise_is_the_seeds(seed: int) -> None:
    said = [b"".join(make_emulator("pvdf", number).advance(10**9)) for number in (seed, seed, seed + 1)]
    assert said[0] == said[1]
    assert said[0] != said[2]
