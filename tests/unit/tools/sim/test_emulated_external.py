from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from slipd.devices.external import Decoder
from slipd.tools.sim.emulated_external import PAD, WRENCH, make
from slipd.types.samples import ArmSample

S = 1_000_000_000


def test_streams_have_the_rates_that_are_asked_for_times_of_this_host_and_an_arm_beside_them() -> None:
    decoder = Decoder()
    emulator = make(1, arms=("arm",), rates_hz={WRENCH: 50.0, PAD: 20.0, "arm": 250.0})
    emulator.began_ns = 7 * S
    emulator.carry(np.array((0.0, 0.0, 9.8)), np.array((1.0, 0.0, 0.0)), sensor="arm")
    samples = [sample for data in emulator.advance(S) for sample in decoder.receive(data, 0)]
    assert Counter(sample.source for sample in samples) == {WRENCH: 50, PAD: 20, "arm": 250}
    times_ns = [sample.device_time_ns for sample in samples]
    assert times_ns == sorted(times_ns)
    assert (times_ns[0], times_ns[-1]) == (7 * S + S / 250, 8 * S)
    motions = [sample for sample in samples if isinstance(sample, ArmSample)]
    assert np.mean([sample.gravity_mps2 for sample in motions], axis=0) == pytest.approx((0.0, 0.0, 9.8), abs=0.01)
    assert np.mean([sample.angular_velocity_radps for sample in motions], axis=0) == pytest.approx((1, 0, 0), abs=0.001)
