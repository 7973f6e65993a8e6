"""Faulty taxels are found within a second; taxels without load are not called faulty."""

from __future__ import annotations

import csv
import math
import tomllib

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from project import CONFIG, TRIAL
from taxel_images import COLS, END_S, LOST_S, N_PER_COUNT, NOISE, OFFSET, ROWS, TAXELS, WIDE, counts, feed, swing, watch

from slipd.signals.taxel_health import TaxelHealth
from slipd.tools.sim.scene_parts import Patch

GRIPS_TOML = CONFIG / "grips.toml"

FAULTS = {
    "dead": lambda was, rng: OFFSET * rng.normal(size=was.shape[1]) + NOISE * rng.normal(size=was.shape),
    "no signal at all": lambda was, rng: np.zeros_like(was),
    "stuck where it was": lambda was, rng: np.broadcast_to(was[0], was.shape),
    "stuck at some value": lambda was, rng: np.broadcast_to(rng.uniform(500.0, 8000.0, was.shape[1]), was.shape),
    "saturated": lambda was, rng: np.full_like(was, 32_767.0),
    "garbage": lambda was, rng: 2000.0 * rng.normal(size=was.shape),
    "loose": lambda was, rng: np.where(rng.random(was.shape) < 0.5, was, 2000.0 + NOISE * rng.normal(size=was.shape)),
}


@pytest.mark.parametrize("rate_hz", [30.0, 500.0])
@pytest.mark.parametrize("fault", FAULTS)
def test_T1_every_taxel_that_is_lost_under_a_swinging_load_is_masked_within_a_second(
    fault: str, rate_hz: float
) -> None:
    """Taxels three apart are lost together; nine such sets are all taxels of the pad, three are taken at 500 Hz."""
    t_s = np.arange(0.0, END_S, 1.0 / rate_hz)
    row, col = np.divmod(np.arange(TAXELS), COLS)
    for which in range(0, 9, 1 if rate_hz < 100.0 else 4):
        rng = np.random.default_rng(which)
        lost = (row % 3 == which // 3) & (col % 3 == which % 3)
        images = counts(swing(t_s), WIDE, rng)
        later = t_s >= LOST_S
        images[np.ix_(later, lost)] = np.rint(FAULTS[fault](images[np.ix_(later, lost)], rng))
        health = watch()
        changes = feed(health, images, rate_hz, swing(t_s))
        assert_array_equal(health.masked, lost)
        assert all(LOST_S <= t <= LOST_S + 1.001 for t, _ in changes)


def test_T1_a_taxel_that_jitters_alone_though_nothing_touches_the_pad_is_hot() -> None:
    t_s = np.arange(0.0, 3.0, 1 / 30)
    for k in range(0, TAXELS, 31):
        rng = np.random.default_rng(k)
        images = counts(0.0 * t_s, WIDE, rng)
        images[30:, k] += 1000.0 * rng.normal(size=len(t_s) - 30)
        health = watch(light_touch=0.8)
        feed(health, images, 30.0, 0.0 * t_s)
        assert health.report()["hot"] == [k]


def test_T1_a_taxel_that_is_high_though_nothing_touches_the_pad_is_hot() -> None:
    t_s = np.arange(0.0, 2.0, 1 / 30)
    for k in range(0, TAXELS, 7):
        images = counts(0.0 * t_s, WIDE, np.random.default_rng(k))
        images[30:, k] += 2000.0
        health = watch(light_touch=0.8)
        changes = feed(health, images, 30.0, 0.0 * t_s)
        assert health.report()["hot"] == [k]
        assert changes[0][0] <= 2.0


def test_T1_a_reading_far_above_its_loaded_neighbours_is_hot() -> None:
    t_s = np.arange(0.0, END_S, 1 / 100)
    images = counts(swing(t_s), WIDE, np.random.default_rng(1))
    images[t_s >= LOST_S, 70] += 6000.0
    health = watch()
    feed(health, images, 100.0, swing(t_s))
    assert health.report()["hot"] == [70]


def test_T1_a_constant_charge_is_hot_once_it_is_reconstructed() -> None:
    """The amplifier's output says little under a held load; the reconstruction shows a force that no contact makes."""
    health = watch()
    quiet = counts(np.zeros(200), WIDE, np.random.default_rng(2)) * N_PER_COUNT
    pressure = np.full(TAXELS, 0.3)
    pressure[40] = 5.0
    for k, image in enumerate(quiet):
        health.update(image, 10_000_000 * k, False, False, pressure if k < 150 else np.full(TAXELS, math.nan))
    assert health.report()["hot"] == [40]


@pytest.mark.parametrize(("row", "rate_hz"), [*((row, 30.0) for row in range(ROWS)), (0, 500.0), (3, 500.0)])
def test_T1_a_lost_row_is_reported_as_a_row(row: int, rate_hz: float) -> None:
    t_s = np.arange(0.0, END_S, 1 / rate_hz)
    images = counts(swing(t_s), WIDE, np.random.default_rng(row))
    images[t_s >= LOST_S, row * COLS : (row + 1) * COLS] = 0.0
    health = watch()
    feed(health, images, rate_hz, swing(t_s))
    assert health.report() == {"dead": [], "stuck": [], "hot": [], "saturated": [], "row": [row], "column": []}
    assert health.usable


@pytest.mark.parametrize("col", range(1, COLS - 1, 3))
def test_T1_a_lost_column_that_still_has_noise_is_reported_as_a_column(col: int) -> None:
    t_s = np.arange(0.0, END_S, 1 / 30)
    rng = np.random.default_rng(col)
    images = counts(swing(t_s), WIDE, rng)
    images[t_s >= LOST_S, col::COLS] = np.rint(NOISE * rng.normal(size=(np.count_nonzero(t_s >= LOST_S), ROWS)))
    health = watch()
    feed(health, images, 30.0, swing(t_s))
    assert health.report()["column"] == [col]
    assert_array_equal(np.flatnonzero(health.masked), np.arange(col, TAXELS, COLS))


CONTACTS = {
    "a block": Patch(),
    "a point": Patch(0.002, 0.002, 2.0, (0.0016, 0.0016)),
    "a point on one taxel": Patch(0.0024, 0.0024, 2.0, (0.0144, -0.0048)),
    "an edge": Patch(0.025, 0.0022, 4.0, (0.0, 0.0016)),
    "a block over the border": Patch(0.012, 0.009, 4.0, (0.022, 0.010)),
    "a ball over the whole pad": Patch(0.028, 0.015, 2.0, (0.0, 0.0)),
    "a box with a corner left out": Patch(0.026, 0.0135, 4.0, (0.0, 0.0)),
}


@pytest.mark.parametrize("rate_hz", [30.0, 250.0])
@pytest.mark.parametrize("contact", CONTACTS)
def test_T1_no_taxel_of_a_well_pad_is_masked(contact: str, rate_hz: float) -> None:
    """The force swings and trembles at 15 Hz, is held, and let go."""
    t_s = np.arange(0.0, 5.5, 1 / rate_hz)
    force_n = 0.4 * swing(t_s) * (1.0 + 0.1 * np.sin(2.0 * np.pi * 15.0 * t_s)) * np.clip((4.5 - t_s) / 0.2, 0.0, 1.0)
    force_n[(t_s > 3.0) & (t_s < 3.9)] = 5.0
    health = watch(light_touch=0.8)
    images = counts(force_n, CONTACTS[contact], np.random.default_rng(5))
    assert feed(health, images, rate_hz, force_n) == []


def test_T1_a_pad_that_is_silent_at_rest_keeps_its_unloaded_taxels() -> None:
    """Some pads send plain zeros where nothing presses; those bits may rest beside bits that do not."""
    t_s = np.arange(0.0, 4.0, 1 / 30)
    images = counts(swing(t_s), CONTACTS["a block"], np.random.default_rng(6))
    images[images < 100.0] = 0.0
    health = watch()
    assert feed(health, images, 30.0, swing(t_s)) == []
    images[60:, 72] = images[60, 72]
    health = watch()
    feed(health, images, 30.0, swing(t_s))
    assert health.report()["stuck"] == [72]


def test_T4_hum_on_all_taxels_masks_none() -> None:
    t_s = np.arange(0.0, 3.0, 1 / 500)
    hum = np.rint(300.0 * np.sin(2.0 * np.pi * 50.0 * t_s))[:, None]
    for force_n in (swing(t_s), 0.0 * t_s):
        images = counts(force_n, CONTACTS["a block"], np.random.default_rng(7)) + hum
        assert feed(watch(), images, 500.0, force_n) == []


def test_T4_a_pad_that_warms_as_a_whole_masks_none() -> None:
    t_s = np.arange(0.0, 5.0, 1 / 100)
    images = counts(0.0 * t_s, WIDE, np.random.default_rng(8)) + np.rint(500.0 * t_s)[:, None]
    assert feed(watch(), images, 100.0, 0.0 * t_s) == []


def test_T1_a_point_that_trembles_alone_under_a_moving_force_is_a_contact() -> None:
    """Nothing but the force sensor can tell it from garbage: it is garbage once the force rests."""
    rng = np.random.default_rng(9)
    images = counts(np.zeros(300), WIDE, rng)
    images[:, 20] += np.rint(3000.0 + 1500.0 * rng.normal(size=300))
    for moving, told in ((True, []), (None, []), (False, [20])):
        health = watch()
        for k, image in enumerate(images):
            health.update(N_PER_COUNT * image, 10_000_000 * k, False, moving)
        assert health.report()["hot"] == told


def test_T1_no_taxel_of_a_real_pad_is_masked_in_a_real_grip() -> None:
    for finger, sensor in (("left", 1), ("right", 2)):
        times_ns, taxels = real_pad(finger, sensor)
        for known in (True, False):
            health = TaxelHealth(4, 4, full_scale=28_000.0)
            for t_ns, image in zip(times_ns, taxels, strict=True):
                free = bool(image[:, 2].sum() < 500.0)
                shear = image[:, :2] if known else None
                health.update(image[:, 2], int(t_ns), free if known else None, not free if known else None, shear=shear)
                assert not health.masked.any()


def test_T1_charge_that_comes_back_after_a_release_does_not_make_the_taxel_between_dead() -> None:
    """All round it the amplifiers relax from below zero: that is no load."""
    t_s = np.arange(0.0, 3.0, 1 / 100)
    images = counts(0.0 * t_s, WIDE, np.random.default_rng(13))
    around = np.array([53, 54, 55, 69, 71, 85, 86, 87])
    images[:, around] -= np.rint(800.0 * np.exp(-t_s / 2.0))[:, None]
    assert feed(watch(), images, 100.0, np.full_like(t_s, 5.0)) == []


def test_T1_a_second_point_that_trembles_with_the_rest_is_a_contact() -> None:
    rng = np.random.default_rng(14)
    force_n = 10.0 + 4.0 * rng.normal(size=300)
    images = counts(force_n, Patch(0.006, 0.006, 2.0, (-0.016, 0.0)), rng)
    images[:, 77] = np.rint(100.0 * force_n)
    assert feed(watch(), images, 100.0, force_n) == []
    images[:, 77] = np.rint(100.0 * force_n[::-1])
    health = watch()
    feed(health, images, 100.0, force_n)
    assert health.report()["hot"] == [77]


def test_T1_a_spire_with_loaded_taxels_on_one_side_only_is_a_contact() -> None:
    quiet = counts(np.zeros(200), WIDE, np.random.default_rng(15)) * N_PER_COUNT
    for beside, told in (((53, 54, 55), []), ((53, 54, 55, 69, 71), [70])):
        pressure = np.zeros(TAXELS)
        pressure[list(beside)], pressure[70] = 0.3, 5.0
        health = watch()
        for k, image in enumerate(quiet):
            health.update(image, 10_000_000 * k, False, False, pressure)
        assert health.report()["hot"] == told


def test_T1_a_corner_that_is_silent_beside_a_rounded_contact_is_well() -> None:
    t_s = np.arange(0.0, 4.0, 1 / 30)
    images = counts(swing(t_s), CONTACTS["a box with a corner left out"], np.random.default_rng(16))
    images[images < 100.0] = 0.0
    assert feed(watch(), images, 30.0, swing(t_s)) == []


def test_T1_a_taxel_in_a_hole_of_a_contact_is_well_where_its_shear_moves_and_dead_where_it_does_not() -> None:
    t_s = np.arange(0.0, 4.0, 1 / 40)
    rng = np.random.default_rng(18)
    images = counts(swing(t_s), WIDE, rng)
    images[:, 70] = np.rint(NOISE * rng.normal(size=len(t_s)))
    shears = 0.2 * images[:, :, None] * np.array([0.6, 0.8])
    for shear_counts, told in ((60.0, []), (0.0, [70])):
        shears[:, 70] = shear_counts * np.sin(2.0 * np.pi * t_s)[:, None] + NOISE * rng.normal(size=(len(t_s), 2))
        health = watch()
        for t, image, shear in zip(t_s, N_PER_COUNT * images, N_PER_COUNT * shears, strict=True):
            health.update(image, round(t * 1e9), False, True, shear=shear)
        assert health.report()["dead"] == told


@pytest.mark.parametrize("fault", ["dead", "stuck where it was", "garbage"])
def test_T1_a_taxel_of_a_real_pad_that_is_lost_in_a_real_grip_is_masked(fault: str) -> None:
    """All axes of a taxel are lost together. The drop moves the load; images repeat as recorded."""
    times_ns, taxels = real_pad("right", 2)
    for lost in (5, 6, 9):
        images, later = taxels.copy(), times_ns - times_ns[0] > 1_000_000_000
        images[later, lost] = FAULTS[fault](images[later, lost], np.random.default_rng(lost))
        repeats = np.flatnonzero((taxels[1:] == taxels[:-1]).all(axis=(1, 2))) + 1
        for k in repeats:
            images[k] = images[k - 1]
        health = TaxelHealth(4, 4)
        for t_ns, image in zip(times_ns, images, strict=True):
            health.update(image[:, 2], int(t_ns), None, None, shear=image[:, :2])
        assert np.flatnonzero(health.masked).tolist() == [lost]


def real_pad(finger: str, sensor: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the times of a real trial, ns, and the counts of one pad in it, shape (images, taxels, 3)."""
    tare = tomllib.loads(GRIPS_TOML.read_text(encoding="utf-8"))["finger"][finger]["pad"]["tare"]
    with (TRIAL / "robot_state.csv").open(encoding="utf-8") as file:
        times_ns = np.array([round(float(row["time"]) * 1e9) for row in csv.DictReader(file)])
    counted = np.loadtxt(TRIAL / f"xela_sensor{sensor}.csv", delimiter=",", skiprows=1)
    return times_ns, (counted - tare).reshape(-1, 16, 3)
