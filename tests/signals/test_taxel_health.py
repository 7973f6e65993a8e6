"""Taxels that lie are found within a second, and those that merely feel nothing are left alone."""

from __future__ import annotations

import csv
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from slipd.signals.taxel_health import BLOCK_IMAGES, TaxelHealth
from slipd.sim.contact import Pad, Patch

ROWS, COLS = 8, 16
TAXELS = ROWS * COLS
N_PER_COUNT = 0.0005
FULL_SCALE = 32_767 * N_PER_COUNT
NOISE, OFFSET = 2.0, 20.0
LOST_S, END_S = 2.0, 3.2
"""When a taxel is lost, and the end of the data: found within 1 s leaves a little over for the last block."""

DATA = Path(__file__).parents[1] / "data" / "grips" / "2022-02-22-08-10-01"
GRIPS_TOML = Path(__file__).parents[2] / "config" / "grips.toml"


def watch(**options: float) -> TaxelHealth:
    settings = {"full_scale": FULL_SCALE, "threshold": 0.005, **options}
    return TaxelHealth(ROWS, COLS, **settings)


def swing(t_s: np.ndarray) -> np.ndarray:
    """A grip from 0.8 s on whose force swings about 20 N once a second."""
    return np.clip((t_s - 0.8) / 0.3, 0.0, 1.0) * (20.0 + 7.0 * np.sin(2.0 * np.pi * t_s))


def counts(force_n: np.ndarray, patch: Patch, rng: np.random.Generator, *, charge_tau_s: float = 0.0) -> np.ndarray:
    """What a pad sends: a spread of gains and offsets, noise, whole counts; shape (images, taxels)."""
    gain = 2000.0 * (1.0 + 0.03 * rng.normal(size=TAXELS)) * Pad(ROWS, COLS).shares(patch)
    felt = force_n[:, None] * gain
    return np.rint(felt + OFFSET * rng.normal(size=TAXELS) + NOISE * rng.normal(size=felt.shape))


def feed(
    health: TaxelHealth, images: np.ndarray, rate_hz: float, force_n: np.ndarray, *, begin_s: float = 0.0
) -> list[tuple[float, np.ndarray]]:
    """Feeds images in counts; tells when ``masked`` changed, and what it was then."""
    span = max(round(0.1 * rate_hz), 1)
    moving = maximum_filter1d(force_n, span) - minimum_filter1d(force_n, span) > 0.1
    changes = []
    for k, image in enumerate(N_PER_COUNT * images):
        before = health.masked
        t_s = begin_s + k / rate_hz
        health.update(image, round(t_s * 1e9), bool(force_n[k] < 0.8), bool(moving[k]))
        if health.masked is not before and (health.masked != before).any():
            changes.append((t_s, health.masked))
    return changes


WIDE = Patch(0.032, 0.018, 8.0, (0.0, 0.0))
"""Presses on every taxel."""

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
def test_T1_a_lost_row_is_told_as_such(row: int, rate_hz: float) -> None:
    t_s = np.arange(0.0, END_S, 1 / rate_hz)
    images = counts(swing(t_s), WIDE, np.random.default_rng(row))
    images[t_s >= LOST_S, row * COLS : (row + 1) * COLS] = 0.0
    health = watch()
    feed(health, images, rate_hz, swing(t_s))
    assert health.report() == {"dead": [], "stuck": [], "hot": [], "saturated": [], "row": [row], "column": []}
    assert health.usable


@pytest.mark.parametrize("col", range(1, COLS - 1, 3))
def test_T1_a_lost_column_that_still_has_noise_is_told_as_such(col: int) -> None:
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


def test_T1_a_sharp_contact_beyond_full_scale_is_believed_again_soon_after() -> None:
    t_s = np.arange(0.0, 3.0, 1 / 100)
    force_n = np.where((t_s > 0.3) & (t_s < 1.5), 20.0, 0.0)
    images = counts(force_n, WIDE, np.random.default_rng(0))
    images[force_n > 0.0, 50] = 32_767.0
    health = watch()
    (found_s, masked), (mended_s, after) = feed(health, images, 100.0, force_n)
    assert_array_equal(np.flatnonzero(masked), [50])
    assert found_s <= 1.3
    assert not after.any()
    assert mended_s <= 2.2


def test_T1_a_taxel_that_feels_again_is_believed_after_some_seconds() -> None:
    t_s = np.arange(0.0, 14.0, 1 / 100)
    rng = np.random.default_rng(3)
    images = counts(swing(t_s), WIDE, rng)
    gone = (t_s >= LOST_S) & (t_s < 5.0)
    images[gone, 37] = np.rint(NOISE * rng.normal(size=np.count_nonzero(gone)))
    changes = feed(watch(), images, 100.0, swing(t_s))
    assert [bool(masked[37]) for _, masked in changes] == [True, False]
    assert 9.0 < changes[1][0] < 11.0


def test_T1_a_row_that_feels_again_is_believed_again() -> None:
    t_s = np.arange(0.0, 12.0, 1 / 100)
    rng = np.random.default_rng(4)
    images = counts(swing(t_s), WIDE, rng)
    gone = (t_s >= LOST_S) & (t_s < 4.0)
    images[gone, 48:64] = np.rint(NOISE * rng.normal(size=(np.count_nonzero(gone), COLS)))
    health = watch()
    changes = feed(health, images, 100.0, swing(t_s))
    assert changes[0][1][48:64].all()
    assert not health.masked.any()


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
    tares = tomllib.loads(GRIPS_TOML.read_text(encoding="utf-8"))["finger"]
    with (DATA / "robot_state.csv").open(encoding="utf-8") as file:
        times_ns = [round(float(row["time"]) * 1e9) for row in csv.DictReader(file)]
    for finger, sensor in (("left", 1), ("right", 2)):
        readings = np.loadtxt(DATA / f"xela_sensor{sensor}.csv", delimiter=",", skiprows=1)[:, 2:48:3]
        readings -= np.array(tares[finger]["pad"]["tare"])[2::3]
        for known in (True, False):
            health = TaxelHealth(4, 4, full_scale=28_000.0)
            for t_ns, image in zip(times_ns, readings, strict=True):
                free = bool(image.sum() < 500.0)
                health.update(image, t_ns, free if known else None, not free if known else None)
                assert not health.masked.any()


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_N1_an_image_with_a_reading_that_is_no_number_changes_nothing(bad: float) -> None:
    t_s = np.arange(0.0, END_S, 1 / 100)
    images = counts(swing(t_s), WIDE, np.random.default_rng(10))
    images[t_s >= LOST_S, 5] = 0.0
    images[::7, 90] = bad
    health = watch()
    feed(health, images, 100.0, swing(t_s))
    assert_array_equal(np.flatnonzero(health.masked), [5])


def test_repeated_images_and_silences_are_no_fault_of_a_taxel() -> None:
    t_s = np.arange(0.0, 4.0, 1 / 60)
    images = counts(swing(t_s), WIDE, np.random.default_rng(11))
    images[1::12] = images[0::12][: len(images[1::12])]
    health = watch()
    assert feed(health, images, 60.0, swing(t_s)) == []
    assert feed(health, images, 60.0, swing(t_s), begin_s=5.0) == []
    frozen = np.broadcast_to(images[-1], images.shape)
    assert feed(health, frozen, 60.0, swing(t_s), begin_s=20.0) == [], "the whole array hangs: no neighbour tells"


def test_a_flood_of_images_is_judged_by_a_part_of_it() -> None:
    rate_hz = 20.0 * BLOCK_IMAGES
    t_s = np.arange(0.0, END_S, 1 / rate_hz)
    images = counts(swing(t_s), WIDE, np.random.default_rng(12))
    images[t_s >= LOST_S, 64] = 0.0
    health = watch()
    feed(health, images, rate_hz, swing(t_s))
    assert_array_equal(np.flatnonzero(health.masked), [64])


def test_repair_puts_the_median_of_the_believed_neighbours_in_place() -> None:
    health = TaxelHealth(3, 3)
    pressure = np.arange(9.0)
    assert health.repair(pressure) is pressure
    health.masked = np.array([False, False, False, False, True, False, False, False, True])
    assert_array_equal(health.repair(pressure), [0, 1, 2, 3, 3, 5, 6, 7, 6], "of 0 1 2 3 5 6 7, and of 5 7")
    assert pressure[4] == 4.0
    health.masked = np.ones(9, dtype=bool)
    assert not health.repair(pressure).any()


def test_an_image_with_too_many_masked_taxels_is_not_usable() -> None:
    health = watch()
    assert health.usable
    health.masked = np.arange(TAXELS) < 0.25 * TAXELS
    assert health.usable
    health.masked = np.arange(TAXELS) <= 0.25 * TAXELS
    assert not health.usable


def test_a_pad_of_one_line_has_no_lines_to_lose() -> None:
    health = TaxelHealth(1, 2)
    health.masked = np.ones(2, dtype=bool)
    assert health.report()["row"] == []


def test_a_bad_call_is_refused() -> None:
    with pytest.raises(ValueError, match="each side must be at least 1"):
        TaxelHealth(0, 4)
    with pytest.raises(ValueError, match="full_scale must be positive"):
        TaxelHealth(4, 4, full_scale=0.0)
    with pytest.raises(ValueError, match=r"an image of shape \(9,\)"):
        TaxelHealth(4, 4).update(np.zeros(9), 0, None, None)


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


def test_what_moved_before_a_silence_is_not_held_against_what_rests_after_it() -> None:
    """A contact with a hole is gripped while nobody looks; a hole and a dead taxel look the same then."""
    rng = np.random.default_rng(17)
    held = counts(np.full(300, 10.0), WIDE, rng)
    held[:, 70] = np.rint(NOISE * rng.normal(size=300))
    health = watch()
    assert feed(health, counts(np.zeros(300), WIDE, rng), 100.0, np.zeros(300)) == []
    assert feed(health, held, 100.0, np.full(300, 10.0), begin_s=10.0) == []
