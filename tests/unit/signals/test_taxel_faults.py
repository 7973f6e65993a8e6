"""Faulty taxels are masked within a second, filled, and trusted again; taxels without load are not called faulty."""

from __future__ import annotations

import csv
import math
import tomllib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from plain_kernels import run_without_compilation
from project import CONFIG, TRIAL
from taxel_images import COLS, END_S, LOST_S, N_PER_COUNT, NOISE, OFFSET, ROWS, TAXELS, WIDE, counts, feed, swing, watch

from slipd.signals import taxel_blocks, taxel_faults, taxel_neighbours
from slipd.signals.taxel_health import TaxelHealth
from slipd.tools.sim.scene_parts import Patch
from slipd.types.arrays import Array

FAULTS = {
    "dead": lambda was, rng: OFFSET * rng.normal(size=was.shape[1]) + NOISE * rng.normal(size=was.shape),
    "no signal at all": lambda was, rng: np.zeros_like(was),
    "stuck where it was": lambda was, rng: np.broadcast_to(was[0], was.shape),
    "stuck at some value": lambda was, rng: np.broadcast_to(rng.uniform(500.0, 8000.0, was.shape[1]), was.shape),
    "saturated": lambda was, rng: np.full_like(was, 32_767.0),
    "garbage": lambda was, rng: 2000.0 * rng.normal(size=was.shape),
    "loose": lambda was, rng: np.where(rng.random(was.shape) < 0.5, was, 2000.0 + NOISE * rng.normal(size=was.shape)),
}
CONTACTS = {
    "a block": Patch(),
    "a point": Patch(0.002, 0.002, 2.0, (0.0016, 0.0016)),
    "a point on one taxel": Patch(0.0024, 0.0024, 2.0, (0.0144, -0.0048)),
    "an edge": Patch(0.025, 0.0022, 4.0, (0.0, 0.0016)),
    "a block over the border": Patch(0.012, 0.009, 4.0, (0.022, 0.010)),
    "a ball over the whole pad": Patch(0.028, 0.015, 2.0, (0.0, 0.0)),
    "a box with a corner left out": Patch(0.026, 0.0135, 4.0, (0.0, 0.0)),
}


class Course:
    """Images of a pad under a force.

    Args:
        rate_hz: Rate of the images.
        end_s: Duration, s.
        force_n: Force of each image; None: one that swings.
        patch: What presses.
        seed: Of noise, gains and offsets.

    Attributes:
        images: Counts, shape (images, taxels), to be spoilt.
    """

    def __init__(
        self,
        rate_hz: float = 100.0,
        end_s: float = END_S,
        force_n: Array | None = None,
        patch: Patch = WIDE,
        seed: int = 1,
    ) -> None:
        self.rate_hz, self.rng = rate_hz, np.random.default_rng(seed)
        self.t_s = np.arange(0.0, end_s, 1.0 / rate_hz)
        self.force_n = swing(self.t_s) if force_n is None else np.broadcast_to(force_n, self.t_s.shape)
        self.images = counts(self.force_n, patch, self.rng)

    def noise(self, since_s: float, until_s: float, *taxels: int) -> None:
        """Leave nothing but noise of some taxels."""
        gone = np.ix_((self.t_s >= since_s) & (self.t_s < until_s), taxels)
        self.images[gone] = np.rint(NOISE * self.rng.normal(size=self.images[gone].shape))

    def watch(self, **options: float) -> tuple[TaxelHealth, list[tuple[float, Array]]]:
        """Return the health at the end, and what was masked when that changed."""
        health = watch(**options)
        return health, feed(health, self.images, self.rate_hz, self.force_n)

    def report(self, **options: float) -> dict[str, list[int]]:
        """Return what is reported at the end, by kind."""
        return {kind: taxels for kind, taxels in self.watch(**options)[0].report().items() if taxels}


@pytest.mark.parametrize("rate_hz", [30.0, 500.0])
@pytest.mark.parametrize("fault", FAULTS)
def test_T1_every_taxel_that_is_lost_under_a_swinging_load_is_masked_within_a_second(
    fault: str, rate_hz: float
) -> None:
    """Taxels three apart are lost together; nine such sets are all taxels of the pad, three are taken at 500 Hz."""
    row, col = np.divmod(np.arange(TAXELS), COLS)
    for which in range(0, 9, 1 if rate_hz < 100.0 else 4):
        course = Course(rate_hz, seed=which)
        lost = (row % 3 == which // 3) & (col % 3 == which % 3)
        gone = np.ix_(course.t_s >= LOST_S, lost)
        course.images[gone] = np.rint(FAULTS[fault](course.images[gone], course.rng))
        health, changes = course.watch()
        assert_array_equal(health.masked, lost)
        assert_array_equal(health.measured, ~lost)
        assert all(LOST_S <= t <= LOST_S + 1.001 for t, _ in changes)


@pytest.mark.parametrize("jitters", [False, True])
def test_T1_a_taxel_that_is_high_or_jitters_though_nothing_touches_the_pad_is_hot(jitters: bool) -> None:
    for k in range(0, TAXELS, 31 if jitters else 7):
        course = Course(30.0, 3.0 if jitters else 2.0, np.zeros(1), seed=k)
        course.images[30:, k] += 1000.0 * course.rng.normal(size=len(course.images) - 30) if jitters else 2000.0
        health, changes = course.watch(light_touch=0.8)
        assert health.report()["hot"] == [k]
        assert changes[0][0] <= 2.2


def test_T1_a_reading_far_above_its_loaded_neighbours_is_hot_also_in_reconstructed_charge() -> None:
    """The amplifier's output says little under a held load; the reconstruction shows a force that no contact makes."""
    course = Course()
    course.images[course.t_s >= LOST_S, 70] += 6000.0
    assert course.report() == {"hot": [70]}
    quiet = N_PER_COUNT * Course(end_s=2.0, force_n=np.zeros(1)).images
    for beside, hot in (((53, 54, 55), []), ((53, 54, 55, 69, 71), [70]), (range(TAXELS), [70])):
        health, pressure = watch(), np.zeros(TAXELS)
        pressure[list(beside)], pressure[70] = 0.3, 5.0
        for k, image in enumerate(quiet):
            health.update(image, 10_000_000 * k, False, False, pressure if k < 150 else np.full(TAXELS, math.nan))
        assert health.report()["hot"] == hot


@pytest.mark.parametrize(("row", "rate_hz"), [*((row, 30.0) for row in range(ROWS)), (3, 500.0)])
def test_T1_a_lost_row_is_reported_as_a_row(row: int, rate_hz: float) -> None:
    course = Course(rate_hz, seed=row)
    course.images[course.t_s >= LOST_S, row * COLS : (row + 1) * COLS] = 0.0
    health, _ = course.watch()
    assert health.report() == {"dead": [], "stuck": [], "hot": [], "saturated": [], "row": [row], "column": []}
    assert health.usable


@pytest.mark.parametrize("col", range(1, COLS - 1, 3))
def test_T1_a_lost_column_that_still_has_noise_is_reported_as_a_column(col: int) -> None:
    course = Course(30.0, seed=col)
    course.noise(LOST_S, END_S, *range(col, TAXELS, COLS))
    assert course.report() == {"column": [col]}


@pytest.mark.parametrize("rate_hz", [30.0, 250.0])
@pytest.mark.parametrize("contact", CONTACTS)
def test_T1_no_taxel_of_a_well_pad_is_masked(contact: str, rate_hz: float) -> None:
    """The force swings and trembles at 15 Hz, is held, and let go."""
    t_s = np.arange(0.0, 5.5, 1 / rate_hz)
    force_n = 0.4 * swing(t_s) * (1.0 + 0.1 * np.sin(2.0 * np.pi * 15.0 * t_s)) * np.clip((4.5 - t_s) / 0.2, 0.0, 1.0)
    force_n[(t_s > 3.0) & (t_s < 3.9)] = 5.0
    assert Course(rate_hz, 5.5, force_n, CONTACTS[contact]).report(light_touch=0.8) == {}


@pytest.mark.parametrize("contact", ["a block", "a box with a corner left out"])
def test_T1_a_pad_that_is_silent_at_rest_keeps_its_unloaded_taxels(contact: str) -> None:
    """Some pads send plain zeros where nothing presses; those bits may rest beside bits that do not."""
    course = Course(30.0, 4.0, patch=CONTACTS[contact], seed=6)
    course.images[course.images < 100.0] = 0.0
    assert course.report() == {}
    course.images[60:, 72] = course.images[60, 72]
    assert course.report() == {"stuck": [72]}


def test_T4_hum_warmth_and_charge_that_comes_back_mask_none() -> None:
    """Amplifiers that relax from below zero all round a taxel are no load."""
    for force_n in (None, np.zeros(1)):
        course = Course(500.0, 3.0, force_n, CONTACTS["a block"])
        course.images += np.rint(300.0 * np.sin(2.0 * np.pi * 50.0 * course.t_s))[:, None]
        assert course.report() == {}
    warms, relaxes = Course(end_s=5.0, force_n=np.zeros(1)), Course(end_s=3.0, force_n=np.full(1, 1e-3))
    warms.images += np.rint(500.0 * warms.t_s)[:, None]
    around = [53, 54, 55, 69, 71, 85, 86, 87]
    relaxes.images[:, around] -= np.rint(800.0 * np.exp(-relaxes.t_s / 2.0))[:, None]
    relaxes.force_n = np.full_like(relaxes.t_s, 5.0)
    assert warms.report() == relaxes.report() == {}


def test_T1_a_point_that_trembles_alone_under_a_moving_force_is_a_contact() -> None:
    """Nothing but the force sensor can tell it from garbage: it is garbage once the force rests."""
    course = Course(end_s=3.0, force_n=np.zeros(1))
    course.images[:, 20] += np.rint(3000.0 + 1500.0 * course.rng.normal(size=300))
    for moving, hot in ((True, []), (None, []), (False, [20])):
        health = watch()
        for k, image in enumerate(course.images):
            health.update(N_PER_COUNT * image, 10_000_000 * k, False, moving)
        assert health.report()["hot"] == hot


def test_T1_a_second_point_that_trembles_with_the_rest_is_a_contact() -> None:
    force_n = 10.0 + 4.0 * np.random.default_rng(14).normal(size=300)
    course = Course(end_s=3.0, force_n=force_n, patch=Patch(0.006, 0.006, 2.0, (-0.016, 0.0)))
    course.images[:, 77] = np.rint(100.0 * force_n)
    assert course.report() == {}
    course.images[:, 77] = np.rint(100.0 * force_n[::-1])
    assert course.report() == {"hot": [77]}


def test_T1_a_taxel_in_a_hole_of_a_contact_is_well_where_its_shear_moves_and_dead_where_it_does_not() -> None:
    course = Course(40.0, 4.0)
    course.noise(0.0, 4.0, 70)
    shears = 0.2 * course.images[:, :, None] * np.array([0.6, 0.8])
    for shear_counts, dead in ((60.0, []), (0.0, [70])):
        moves = shear_counts * np.sin(2.0 * np.pi * course.t_s)[:, None]
        shears[:, 70] = moves + NOISE * course.rng.normal(size=(len(moves), 2))
        health = watch()
        for t, image, shear in zip(course.t_s, N_PER_COUNT * course.images, N_PER_COUNT * shears, strict=True):
            health.update(image, round(t * 1e9), False, True, shear=shear)
        assert health.report()["dead"] == dead


@pytest.mark.parametrize("fault", ["none", "dead", "stuck where it was", "garbage"])
@pytest.mark.parametrize(("finger", "sensor"), [("left", 1), ("right", 2)])
def test_T1_a_taxel_of_a_real_pad_is_masked_where_it_is_lost_in_a_real_grip(
    fault: str, finger: str, sensor: int
) -> None:
    """All axes of a taxel are lost together. The drop moves the load; images repeat as recorded."""
    rig = tomllib.loads((CONFIG / "grips.toml").read_text(encoding="utf-8"))
    with (TRIAL / "robot_state.csv").open(encoding="utf-8") as file:
        times_ns = np.array([round(float(row["time"]) * 1e9) for row in csv.DictReader(file)])
    counted = np.loadtxt(TRIAL / f"xela_sensor{sensor}.csv", delimiter=",", skiprows=1)
    taxels = (counted - rig["finger"][finger]["pad"]["tare"]).reshape(-1, 16, 3)
    later, repeats = times_ns - times_ns[0] > 1_000_000_000, (taxels[1:] == taxels[:-1]).all(axis=(1, 2))
    for lost in [] if fault == "none" else [5, 6, 9] if finger == "right" else []:
        images = taxels.copy()
        images[later, lost] = FAULTS[fault](images[later, lost], np.random.default_rng(lost))
        for k in np.flatnonzero(repeats) + 1:
            images[k] = images[k - 1]
        health = TaxelHealth(4, 4)
        for t_ns, image in zip(times_ns, images, strict=True):
            health.update(image[:, 2], int(t_ns), None, None, shear=image[:, :2])
        assert np.flatnonzero(health.masked).tolist() == [lost]
    for known in (True, False) if fault == "none" else ():
        health = TaxelHealth(4, 4, full_scale=28_000.0)
        for t_ns, image in zip(times_ns, taxels, strict=True):
            free, shear = bool(image[:, 2].sum() < 500.0), image[:, :2] if known else None
            health.update(image[:, 2], int(t_ns), free if known else None, not free if known else None, shear=shear)
            assert not health.masks


def test_T1_taxels_that_feel_again_are_believed_after_some_seconds_and_soon_after_saturation() -> None:
    for taxels, until_s in (((37,), 5.0), (range(48, 64), 4.0)):
        course = Course(end_s=14.0, seed=3)
        course.noise(LOST_S, until_s, *taxels)
        (_, masked), (mended_s, after) = course.watch()[1]
        assert_array_equal(np.flatnonzero(masked), taxels)
        assert not after.any()
        assert 4.0 < mended_s - until_s < 6.0
    hard = Course(end_s=3.0, force_n=np.where(np.abs(np.arange(300) - 90) < 60, 20.0, 0.0))
    hard.images[hard.force_n > 0.0, 50] = 32_767.0
    (found_s, masked), (mended_s, after) = hard.watch()[1]
    assert_array_equal(np.flatnonzero(masked), [50])
    assert not after.any()
    assert found_s <= 1.3
    assert mended_s <= 2.2


def scaled(course: Course, share: float, *taxels: int) -> None:
    course.images[30:, taxels] = np.rint(share * course.images[30:, taxels])


def cut_off(course: Course, seconds: float) -> None:
    """Lose a taxel so many seconds before the end."""
    course.images = course.images[: round(30.0 * (1.0 + seconds))]
    scaled(course, 0.0, 70)


def restless(course: Course, counts: float, taxel: int) -> None:
    course.images[:, taxel] += np.rint(counts * course.rng.normal(size=len(course.images)))


def high(course: Course, counts: float) -> None:
    course.images[-60:, 70] += counts


def follows(course: Course, share: float) -> None:
    """Taxel 77 follows the force in part, and the rest of it is the force of another time."""
    course.images[:, 77] = np.rint(100.0 * (share * course.force_n + (1.0 - share) * course.force_n[::-1]))


REST, POINT = {"end_s": 3.0, "force_n": np.zeros(1)}, Patch(0.006, 0.006, 2.0, (-0.016, 0.0))
TREMBLES = {"end_s": 4.0, "force_n": 10.0 + 4.0 * np.random.default_rng(14).normal(size=120), "patch": POINT}
GRIPPED = {"end_s": 8.0, "force_n": np.where(np.arange(240) < 60, 60.0, 0.0), "patch": Patch()}
"""Rubber still presses after a hard grip, the less the longer ago that was."""
PRESSED = {"end_s": 5.0, "force_n": np.full(1, 5.0), "patch": Patch()}


@pytest.mark.parametrize(
    ("spoil", "course", "watched", "limits", "reported"),
    [
        (lambda course, share: scaled(course, share, 70), {"end_s": 5.0}, {}, (0.157, 0.137), {"dead": [70]}),
        (
            lambda course, share: scaled(course, share, *range(48, 64)), {"end_s": 5.0}, {}, (0.08, 0.04),
            {"row": [3]},
        ),
        (cut_off, {"end_s": 5.0}, {}, (0.35, 0.45), {"dead": [70]}),
        (high, REST, {"light_touch": 0.8}, (1480.0, 1690.0), {"hot": [70]}),
        (high, REST, {}, (164.0, 188.0), {"hot": [70]}),
        (high, GRIPPED, {}, (232.0, 237.0), {"hot": [70]}),
        (lambda course, counts: restless(course, counts, 70), REST, {}, (11.5, 13.4), {"hot": [70]}),
        (lambda course, counts: restless(course, counts, 2), PRESSED, {}, (9.9, 11.5), {"hot": [2]}),
        (follows, TREMBLES, {}, (0.39, 0.33), {"hot": [77]}),
    ],
)  # fmt: skip
def test_T1_a_taxel_is_masked_from_these_limits_on(
    spoil: Callable[[Course, float], None], course: dict[str, Any], watched: dict[str, float],
    limits: tuple[float, float], reported: dict[str, list[int]],
) -> None:  # fmt: skip
    """Shares of its readings that are left, or counts on top of them, with which it is not masked, and is."""
    for limit, found in zip(limits, ({}, reported), strict=True):
        spoilt = Course(30.0, **course)
        spoil(spoilt, limit)
        assert spoilt.report(**watched) == found


def test_T1_a_taxel_that_is_lost_beside_two_lost_ones_is_masked_too() -> None:
    course = Course(30.0, 5.0)
    course.noise(1.0, 5.0, 69, 70)
    course.noise(2.5, 5.0, 86)
    assert course.report() == {"dead": [69, 70, 86]}


def test_T1_taxels_are_rated_the_same_by_kernels_that_are_not_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    course = Course(30.0, 5.0)
    course.noise(1.0, 5.0, 69, 70)
    course.images[60:, 16:32] = course.images[60, 16:32]
    course.images[100:110] = course.images[100]
    compiled = course.watch()[1]
    run_without_compilation(monkeypatch, taxel_blocks, taxel_faults, taxel_neighbours)
    for (t_s, masked), (plain_t_s, plain) in zip(compiled, course.watch()[1], strict=True):
        assert t_s == plain_t_s
        assert_array_equal(masked, plain)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_N1_an_image_with_a_reading_that_is_no_number_changes_nothing(bad: float) -> None:
    course = Course()
    course.images[course.t_s >= LOST_S, 5] = 0.0
    course.images[::7, 90] = bad
    assert course.report() == {"dead": [5]}


def test_repair_puts_the_median_of_the_believed_neighbours_in_place() -> None:
    health, pressure = TaxelHealth(3, 3), np.arange(9.0)
    assert health.repair(pressure) is pressure
    health.masked = np.isin(np.arange(9), (4, 8))
    mended = [0, 1, 2, 3, 3, 5, 6, 7, 6]  # of 0 1 2 3 5 6 7, and of 5 7
    assert_array_equal(health.repair(pressure), mended)
    assert_array_equal(health.repair(np.outer(pressure, (1.0, -1.0))), np.outer(mended, (1.0, -1.0)))
    assert pressure[4] == 4.0
    health.masked = np.ones(9, dtype=bool)
    assert not health.repair(pressure).any()


def test_an_image_with_too_many_masked_taxels_is_not_usable_and_one_line_has_no_lines_to_lose() -> None:
    health, line = watch(), TaxelHealth(1, 2)
    for masked in (0, TAXELS // 4, TAXELS // 4 + 1):
        health.masked = np.arange(TAXELS) < masked
        assert health.usable == (masked <= TAXELS // 4)
    line.masked = np.ones(2, dtype=bool)
    assert line.report()["row"] == []
