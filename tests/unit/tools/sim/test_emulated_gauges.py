"""The emulated strain gauges with the decoder of the daemon."""

from __future__ import annotations

import numpy as np
import pytest

from slipd.devices import gauges
from slipd.tools.sim.emulated_gauges import GaugeAmplifier, make

MS = 1_000_000
FORCE_N, TORQUE_NM = np.array([1.0, -2.0, -8.0]), np.array([0.01, 0.02, -0.03])


def test_the_matrix_brings_back_what_it_feels() -> None:
    emulator = make(1)
    emulator.opened(0)
    emulator.feel(FORCE_N, TORQUE_NM)
    assert emulator.receive(b"hello", 0) == []
    decoder = gauges.Decoder(**emulator.options)
    samples = decoder.receive(b"".join(emulator.advance(1000 * MS)), 0)
    assert len(samples) == 1000
    assert np.mean([s.force_n for s in samples], axis=0) == pytest.approx(FORCE_N, abs=0.003)
    assert np.mean([s.torque_nm for s in samples], axis=0) == pytest.approx(TORQUE_NM, abs=1e-4)
    assert np.std([s.force_n for s in samples], axis=0) == pytest.approx([0.02] * 3, rel=0.1)
    assert decoder.health == type(decoder.health)(good=1000)


def test_its_clock_runs_too_fast() -> None:
    samples = gauges.Decoder().receive(b"".join(GaugeAmplifier(2, clock_ppm=1000.0).advance(1000 * MS)), 0)
    assert samples[-1].device_time_ns - samples[0].device_time_ns == 999_999_000


def test_too_much_force_saturates_its_channels() -> None:
    emulator = make(3)
    emulator.feel(np.array([5000.0, 0.0, 0.0]), np.zeros(3))
    (sample,) = gauges.Decoder(**emulator.options).receive(emulator.advance(MS)[0], 0)
    assert sample.status == ("overload",)


def test_frames_for_known_loads_are_those_of_one_load_after_another():
    loads = np.random.default_rng(3).normal(size=(50, 6))
    felt, played = GaugeAmplifier(7), GaugeAmplifier(7)
    one_by_one = []
    for k, load in enumerate(loads, start=1):
        felt.feel(load[:3], load[3:])
        one_by_one += felt.advance(k * 1_000_000)
    assert played.play(loads[:20]) + played.play(loads[20:]) == one_by_one
