"""The measurements of acquisition times and scan skew against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from chart import clocks, skew
from chart.clocks_streams import BOOT_NS, Stream


def test_a_stream_is_late_by_its_poll_and_its_clock_drifts_and_is_reset() -> None:
    device, receipt, true = Stream(1000.0, ppm=500.0, poll_s=0.016, resets_s=((5.0, 0.0),)).readings(10.0, 1)
    late = receipt - true
    assert late.min() > 0
    assert 16e6 < late.max() < 18e6
    before = true < BOOT_NS + 5_000_000_000
    assert np.diff(device[before]).sum() / np.diff(true[before]).sum() == pytest.approx(1.0005, abs=1e-8)
    assert device[~before][0] == 0


def test_a_stall_keeps_all_readings_back_to_its_end() -> None:
    _, receipt, true = Stream(1000.0, stall_every_s=3.0).readings(60.0, 2)
    assert (np.diff(receipt) >= 0).all()
    assert (receipt - true).max() > 10_000_000


def test_the_rivals_are_right_where_nothing_is_late() -> None:
    stream = Stream(1000.0, delay_s=0.0).readings(3.0, 0)
    for make in clocks.RIVALS.values():
        assert np.abs(clocks._told(make(), stream)[-100:]).max() < 1e-6


def test_scaling_brings_a_ramp_to_one_instant() -> None:
    taken = np.linspace(-0.03, 0.0, 7)
    times = np.arange(-0.04, 0.002, 0.001)
    pressure = 2.0 * (10.0 + 100.0 * taken)
    assert skew.common_time(pressure, taken, (times, 10.0 + 100.0 * times), 0.0) == pytest.approx(20.0)


def test_what_the_force_sensor_did_not_see_stays_as_it_is() -> None:
    taken, pressure = np.array((-2.0, -0.5, 0.0)), np.array((1.0, 2.0, 3.0))
    scaled = skew.common_time(pressure, taken, (np.array((-1.0, 0.0)), np.array((4.0, 8.0))), 0.0)
    assert scaled == pytest.approx((1.0, 2.0 * 8.0 / 6.0, 3.0))
    assert skew.common_time(pressure, taken, (np.array((-1.0, 0.0)), np.array((4.0, 0.1))), 0.0) is pressure


def test_a_contact_sampled_at_once_reads_as_the_simulated_pad_does() -> None:
    scene = skew._Scene(np.random.default_rng(1), grows=True)
    image = scene.image(np.full(128, skew.NORMAL_N))
    assert image == pytest.approx(skew.NORMAL_N * skew.PAD.shares(scene.patch), rel=0.1, abs=0.02)


def test_a_few_contacts_fill_tables_and_picture(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:  # type: ignore[no-untyped-def]
    pytest.importorskip("matplotlib")
    from chart import skew_picture

    monkeypatch.setattr(skew, "QUICK_CONTACTS", 2)
    runs, skewed = clocks.run(quick=True), skew.run(quick=True)
    for table in (*clocks.tables(runs), *skewed.tables()):
        assert table.rows
        assert all(len(row) == len(table.head) for row in table.rows)
    skew_picture.save(tmp_path / "time.png", runs, skewed)
    assert (tmp_path / "time.png").stat().st_size > 10_000
