"""Blocks of images: where they end, what they keep, how silence or a flood affects them; an array that hangs."""

from __future__ import annotations

import csv
import math

import numpy as np
import pytest
from nanoseconds import MS
from numpy.testing import assert_allclose, assert_array_equal
from project import TRIAL
from taxel_images import END_S, LOST_S, NOISE, WIDE, counts, feed, swing, watch

from slipd.signals.taxel_blocks import (
    BLOCK_NS,
    CHANGES,
    GAP_NS,
    LEAST,
    MEAN,
    PRESSURE,
    REST,
    ROUGH,
    SHARED,
    SHEAR_SQUARES,
    SHEAR_X,
    SHEAR_Y,
    SQUARES,
    WINDOW,
    Blocks,
)
from slipd.signals.taxel_health import FrozenImage


def fill(blocks: Blocks, images: np.ndarray, *, begin_ns: int = 0, period_ns: int = BLOCK_NS // 3) -> list[int]:
    """Gives images in time; tells which of them ended a block."""
    return [
        k
        for k, image in enumerate(images)
        if blocks.update(image, begin_ns + k * period_ns, free=bool(image.sum() < 7.5), steady=k % 6 < 4, pressure=None)
    ]


def test_a_block_keeps_how_each_taxel_moved_alone_and_with_the_others() -> None:
    images = np.array([[0, 0, 1], [1, 0, 1], [1, 0, 1], [4, 0, 3], [4, 0, 3], [5, 0, 3], [5, 1, 2]], dtype=float)
    blocks = Blocks(3)
    assert fill(blocks, images) == [3, 6]
    newest, before = blocks.last(2)
    expected = {
        MEAN: (images[:4].mean(axis=0), images[4:].mean(axis=0)),
        PRESSURE: (images[:4].mean(axis=0), images[4:].mean(axis=0)),
        LEAST: ([0, 0, 1], [4, 0, 2]),
        SQUARES: ([10, 0, 4], [1, 1, 1]),
        ROUGH: ([5, 0, 4], [5, 1, 5]),  # the images that repeat are no steps
        SHARED: ([6, 0, 6], [0, -1, -1]),
        REST: ([4, 26, 10], [0, 2, 2]),
        CHANGES: ([2, 0, 1], [1, 1, 1]),
    }
    for row, (first, second) in expected.items():
        assert_allclose(blocks.window[[before, newest], row], [first, second], err_msg=str(row))
    assert_array_equal(blocks.run, [1, 0, 0])
    assert_array_equal(blocks.new[[before, newest]], [2, 2])
    assert_array_equal((blocks.free, blocks.steady), [np.arange(WINDOW) == before] * 2)


def test_images_that_are_sent_several_times_move_no_more_roughly() -> None:
    """A pad renews its images 10 times a second; its server sends 10, or 40."""
    rng = np.random.default_rng(19)
    images, shears = rng.normal(size=(20, 3)), rng.normal(size=(20, 3, 2))
    once, often = Blocks(3), Blocks(3)
    for k, (image, shear) in enumerate(zip(images, shears, strict=True)):
        for blocks, times in ((once, 1), (often, 4)):
            for j in range(times):
                t_ns = (k * 4 + j * 4 // times) * 25_000_000
                blocks.update(image, t_ns, free=False, steady=False, shear=shear)
    steps = [SQUARES, ROUGH, SHEAR_SQUARES]
    assert_allclose(often.window[:, steps].sum(axis=0), once.window[:, steps].sum(axis=0))
    assert often.new.sum() == once.new.sum() > 0
    assert_allclose(once.window[once.last(1)[0], SHEAR_X : SHEAR_Y + 1], shears[-1].T)


def test_the_window_is_written_round_and_a_pressure_is_kept_beside_the_readings() -> None:
    blocks = Blocks(1)
    for k in range(WINDOW + 3):
        blocks.update(np.array([float(k)]), k * BLOCK_NS, free=True, steady=True, pressure=np.array([np.nan]))
    assert blocks.count == WINDOW + 2
    assert_array_equal(blocks.window[blocks.last(WINDOW), MEAN, 0], np.arange(WINDOW + 2, 2, -1))
    assert_array_equal(blocks.window[:, PRESSURE], np.zeros((WINDOW, 1)))


def test_a_silence_and_a_clock_that_goes_back_begin_anew() -> None:
    for later_ns in (2 * BLOCK_NS + GAP_NS + 1, BLOCK_NS):
        blocks = Blocks(1)
        fill(blocks, np.zeros((7, 1)))
        assert (blocks.count, blocks.run[0]) == (2, 0)
        blocks.update(np.array([3.0]), later_ns, free=True, steady=True, pressure=None)
        assert blocks.count == 0


def test_repeated_images_and_silences_are_no_fault_of_a_taxel() -> None:
    t_s = np.arange(0.0, 4.0, 1 / 60)
    images = counts(swing(t_s), WIDE, np.random.default_rng(11))
    images[1::12] = images[0::12][: len(images[1::12])]
    health = watch()
    assert feed(health, images, 60.0, swing(t_s)) == []
    assert feed(health, images, 60.0, swing(t_s), begin_s=5.0) == []
    frozen = np.broadcast_to(images[-1], images.shape)
    assert feed(health, frozen, 60.0, swing(t_s), begin_s=20.0) == [], "the whole array hangs: no neighbour tells"


def test_a_flood_of_images_is_judged_like_any_other() -> None:
    rate_hz = 1280.0
    t_s = np.arange(0.0, END_S, 1 / rate_hz)
    images = counts(swing(t_s), WIDE, np.random.default_rng(12))
    images[t_s >= LOST_S, 64] = 0.0
    health = watch()
    feed(health, images, rate_hz, swing(t_s))
    assert_array_equal(np.flatnonzero(health.masked), [64])


def test_what_moved_before_a_silence_is_not_held_against_what_rests_after_it() -> None:
    """A contact with a hole is gripped while nobody looks; a hole and a dead taxel look the same then."""
    rng = np.random.default_rng(17)
    held = counts(np.full(300, 10.0), WIDE, rng)
    held[:, 70] = np.rint(NOISE * rng.normal(size=300))
    health = watch()
    assert feed(health, counts(np.zeros(300), WIDE, rng), 100.0, np.zeros(300)) == []
    assert feed(health, held, 100.0, np.full(300, 10.0), begin_s=10.0) == []


@pytest.mark.parametrize("rate_hz", [30.0, 60.0, 200.0, 500.0])
@pytest.mark.parametrize("seed", range(5))
def test_T3_an_array_that_hangs_while_the_force_moves_is_reported_within_100_ms(rate_hz: float, seed: int) -> None:
    """From its first image that should have differed, with the times of receipt a millisecond to and fro."""
    rng, watch, told_s = np.random.default_rng(seed), FrozenImage(0.2), math.inf
    images = rng.normal(size=(round(rate_hz), 128))
    for k in range(2 * round(rate_hz)):
        t_ns = round(k * 1e9 / rate_hz + MS * rng.uniform(-1.0, 1.0))
        moved_n = 3.0 * math.sin(6.0 * k / rate_hz) if k < rate_hz else 6.0 * (k / rate_hz - 1.0)
        if watch.update(images[min(k, len(images) - 1)].copy(), t_ns, 5.0 + moved_n):
            told_s = min(told_s, t_ns * 1e-9)
    assert 1.0 < told_s <= round(rate_hz) / rate_hz + 0.100
    assert not watch.update(rng.normal(size=128), 3_000 * MS, 5.0)


def test_T3_an_array_may_rest_as_long_as_its_load_does() -> None:
    watch = FrozenImage(0.2)
    for k in range(1000):
        assert not watch.update(np.ones(4), k * 10 * MS, 5.0 + 0.09 * math.sin(k))
    assert watch.update(np.ones(4), 10_000 * MS, 5.3)
    blind = FrozenImage(0.2)
    assert not any(blind.update(np.ones(4), k * 10 * MS, None if k % 2 else math.nan) for k in range(1000))


def test_T3_the_repeated_images_of_a_real_pad_are_no_fault() -> None:
    with (TRIAL / "robot_state.csv").open(encoding="utf-8") as file:
        times_ns = [round(float(row["time"]) * 1e9) for row in csv.DictReader(file)]
    for sensor in (1, 2):
        readings = np.loadtxt(TRIAL / f"xela_sensor{sensor}.csv", delimiter=",", skiprows=1)
        assert (readings[1:] == readings[:-1]).all(axis=1).mean() > 0.05
        watch = FrozenImage(100.0)
        for t_ns, row in zip(times_ns, readings, strict=True):
            assert not watch.update(row, t_ns, float(row[2:48:3].sum()))


def test_T3_an_image_that_repeats_while_the_force_moves_is_suspect_at_once() -> None:
    watch = FrozenImage(0.2)
    for t_ms, normal_n, suspect in ((0, 5.0, False), (10, 5.1, False), (20, 5.3, True), (30, 5.3, True)):
        assert (watch.update(np.ones(4), t_ms * MS, normal_n), watch.suspect) == (False, suspect)
    assert (watch.update(np.zeros(4), 40 * MS, 9.0), watch.suspect) == (False, False)
