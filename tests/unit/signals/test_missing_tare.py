"""An untared pad that reads far from zero is reported; a growing load is not."""

from __future__ import annotations

import numpy as np
import pytest

from slipd.signals.missing_tare import AHEAD_NS, UntaredWatch

MS = 1_000_000


def forces(normal: float, taxels: int = 9) -> np.ndarray:
    """The same force on each taxel, `normal` together."""
    return np.tile((0.0, 0.0, -normal / taxels), (taxels, 1))


@pytest.mark.parametrize(
    ("min_normal", "first", "missing"),
    [(0.3, 9.0, False), (0.3, 11.0, True), (0.3, -11.0, True), (1.0, 19.0, False), (1.0, 21.0, True)],
)
def test_the_first_image_decides_beyond_ten_newtons_and_twenty_contacts(
    min_normal: float, first: float, missing: bool
) -> None:
    watch = UntaredWatch(min_normal, 0.0)
    watch.update_alone(forces(first))
    assert watch.missing == missing


def test_a_load_that_grows_is_one_and_a_pad_seen_near_zero_counts_from_it() -> None:
    watch = UntaredWatch(0.3, 0.0)
    watch.update_alone(forces(0.1))
    watch.update_alone(forces(50.0))
    assert not watch.missing
    watch.forget()
    watch.update_alone(forces(50.0))
    watch.update_alone(forces(5.0))
    assert watch.missing, "not near zero"
    watch.update_alone(forces(0.2))
    assert not watch.missing


def test_a_shear_offset_counts_and_one_hot_taxel_does_not() -> None:
    watch = UntaredWatch(0.3, 0.0)
    image = forces(0.0)
    image[4] = (0.0, 0.0, -65.0)
    watch.update_alone(image)
    assert not watch.missing
    watch.forget()
    watch.update_alone(np.tile((2.0, 0.0, 0.0), (9, 1)))
    assert watch.missing


@pytest.mark.parametrize(
    ("threshold", "calibrated", "reading", "missing"),
    [
        (0.05, False, 0.4, False),
        (0.05, False, 0.6, True),
        (0.0, False, 9.0, False),  # no threshold, no newtons: nothing says what is much
        (0.0, True, 0.5, False),
        (0.0, True, 0.7, True),
    ],
)
def test_beside_a_force_sensor_that_feels_nothing_many_taxels_must_read_much_for_long(
    threshold: float, calibrated: bool, reading: float, missing: bool
) -> None:
    watch = UntaredWatch(0.3, threshold, calibrated=calibrated)
    image = np.full(16, reading)
    watch.update_beside_force(image, 0, free=True)
    watch.update_beside_force(image, AHEAD_NS, free=True)
    assert not watch.missing, "a touch that is on its way to the force sensor"
    watch.update_beside_force(image, AHEAD_NS + MS, free=True)
    assert watch.missing == missing


def test_a_contact_neither_finds_nor_ends_it() -> None:
    watch = UntaredWatch(0.3, 0.05)
    image = np.full(16, 1.0)
    for k in range(100):
        watch.update_beside_force(image, k * 10 * MS, free=k % 10 == 0)
    assert not watch.missing
    for k in range(100, 130):
        watch.update_beside_force(image, k * 10 * MS, free=True)
    assert watch.missing
    watch.update_beside_force(image, 1300 * MS, free=False)
    watch.update_beside_force(np.zeros(16), 1310 * MS, free=False)
    assert watch.missing, "what presses says nothing of the zero"
    watch.update_beside_force(np.zeros(16), 1320 * MS, free=True)
    assert not watch.missing


def test_an_image_with_a_reading_that_is_no_number_decides_nothing() -> None:
    watch = UntaredWatch(0.3, 0.0)
    watch.update_alone(np.full((4, 3), np.nan))
    watch.update_alone(forces(50.0))
    assert watch.missing
