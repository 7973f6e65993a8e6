import math
from dataclasses import replace

import numpy as np
import pytest
from nanoseconds import MS

from slipd.devices import pvdf
from slipd.tools.sim.emulated_pvdf import FULL_SCALE, PvdfElectronics, PvdfPad

IDEAL = PvdfElectronics(gain_spread=0.0, offset_counts=0.0, noise_counts=0.0, clock_ppm=0.0)
EVEN = np.full(128, 1 / 128)


def scans(pad, force_n, end_ns, begin_ns=0, step_ns=MS, shares=EVEN):
    """Plays a force over time; returns the decoded scans."""
    decoder, samples = pvdf.Decoder(), []
    for t in range(begin_ns + step_ns, end_ns + 1, step_ns):
        pad.press(force_n(t * 1e-9) * shares)
        samples += [sample for piece in pad.advance(t) for sample in decoder.receive(piece, t)]
    assert decoder.health.bad == decoder.health.lost == 0
    return samples


def made(electronics=IDEAL, seed=2):
    return PvdfPad(8, 16, electronics, seed)


def test_a_held_force_leaks_away_with_the_time_constant():
    samples = scans(made(), lambda t: 12.8, 3_000 * MS)
    times = np.array([s.device_time_ns for s in samples]) * 1e-9
    assert np.array([s.values[0] for s in samples])[1:] == pytest.approx(200.0 * np.exp(-times[1:] / 2.0), abs=0.6)


def test_taxels_are_sampled_one_after_another():
    sample = scans(made(), lambda t: 1280.0 * t, 1_005 * MS)[-1]  # counts rise by 2e4 a second and leak
    k = np.arange(128)
    rise = np.diff(sample.values[[0, 127]])[0] / (127 * 20e-6)
    assert sample.dwell_ns == 20_000
    assert rise == pytest.approx(20_000 * math.exp(-1.0 / 2.0), rel=0.02)
    assert sample.values == pytest.approx(sample.values[0] + rise * k * 20e-6, abs=1.1)


def test_each_taxel_has_a_charge_of_its_own():
    pad, decoder, samples = made(), pvdf.Decoder(), []
    first, last = np.zeros(128), np.zeros(128)
    first[3], last[90] = 1.0, 1.0
    for t in range(1, 53):
        pad.press(first if t < 20 else last)
        samples = [sample for piece in pad.advance(t * MS) for sample in decoder.receive(piece, 0)] or samples
    values = samples[-1].values
    assert values[[3, 90]] == pytest.approx([0.0, 2000.0], abs=40.0)
    assert np.abs(np.delete(values, [3, 90])).max() == 0.0


def test_a_dead_taxel_reads_the_same_under_every_load_and_no_other_more_than_full_scale():
    samples = scans(made(replace(IDEAL, dead=(5,))), lambda t: 1e5 * t, 500 * MS)
    assert {s.values[5] for s in samples} == {0.0}
    assert samples[0].values[6] < FULL_SCALE == samples[-1].values[6]
