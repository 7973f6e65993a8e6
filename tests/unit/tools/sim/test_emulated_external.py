from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from slipd.devices.external import Decoder
from slipd.tools.sim.emulated_external import PAD, PAD_EVERY, RATE_HZ, WRENCH, make
from slipd.types.samples import ArmSample, TactileSample, WrenchSample

S = 1_000_000_000


def test_both_streams_carry_values_and_times() -> None:
    emulator = make(1)
    emulator.began_ns = 7 * S
    emulator.feel(np.array((1.0, -2.0, 30.0)), np.array((0.1, 0.2, -0.3)))
    emulator.press(np.arange(16.0))
    decoder = Decoder()
    samples = [sample for data in emulator.advance(S) for sample in decoder.receive(data, 0)]
    wrenches = [sample for sample in samples if isinstance(sample, WrenchSample)]
    images = [sample for sample in samples if isinstance(sample, TactileSample)]
    assert Counter(sample.source for sample in samples) == {WRENCH: RATE_HZ, PAD: RATE_HZ / PAD_EVERY}
    assert np.mean([sample.force_n for sample in wrenches], axis=0) == pytest.approx((1.0, -2.0, 30.0), abs=0.01)
    assert np.mean([sample.torque_nm for sample in wrenches], axis=0) == pytest.approx((0.1, 0.2, -0.3), abs=0.001)
    assert np.mean([sample.values for sample in images], axis=0) == pytest.approx(np.arange(16.0), abs=0.01)
    times_ns = [sample.device_time_ns for sample in samples]
    assert times_ns == sorted(times_ns)
    assert (times_ns[0], times_ns[-1]) == (7 * S + S / RATE_HZ, 8 * S)
    assert (decoder.health.bad, decoder.health.lost, decoder.health.duplicates) == (0, 0, 0)


def test_streams_have_the_rates_that_are_asked_for_and_an_arm_pushes_its_motion_beside_them() -> None:
    decoder = Decoder()
    emulator = make(1, arms=("arm",), rates_hz={WRENCH: 50.0, PAD: 20.0, "arm": 250.0})
    emulator.carry(np.array((0.0, 0.0, 9.8)), np.array((1.0, 0.0, 0.0)), sensor="arm")
    samples = [sample for data in emulator.advance(S) for sample in decoder.receive(data, 0)]
    assert Counter(sample.source for sample in samples) == {WRENCH: 50, PAD: 20, "arm": 250}
    motions = [sample for sample in samples if isinstance(sample, ArmSample)]
    assert np.mean([sample.gravity_mps2 for sample in motions], axis=0) == pytest.approx((0.0, 0.0, 9.8), abs=0.01)
    assert np.mean([sample.angular_velocity_radps for sample in motions], axis=0) == pytest.approx((1, 0, 0), abs=0.001)
