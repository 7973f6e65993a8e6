"""Faulty taxels are masked and interpolated, and trusted again some seconds after they respond again."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from taxel_images import COLS, END_S, LOST_S, NOISE, TAXELS, WIDE, counts, feed, swing, watch

from slipd.signals.taxel_health import TaxelHealth


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


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_N1_an_image_with_a_reading_that_is_no_number_changes_nothing(bad: float) -> None:
    t_s = np.arange(0.0, END_S, 1 / 100)
    images = counts(swing(t_s), WIDE, np.random.default_rng(10))
    images[t_s >= LOST_S, 5] = 0.0
    images[::7, 90] = bad
    health = watch()
    feed(health, images, 100.0, swing(t_s))
    assert_array_equal(np.flatnonzero(health.masked), [5])


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
    with pytest.raises(ValueError, match="rows and cols must be at least 1"):
        TaxelHealth(0, 4)
    with pytest.raises(ValueError, match="full_scale must be positive"):
        TaxelHealth(4, 4, full_scale=0.0)
    with pytest.raises(ValueError, match=r"got \(9,\)"):
        TaxelHealth(4, 4).update(np.zeros(9), 0, None, None)
