"""Contact shape of images whose shape is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.fusion import contact_shape

PITCH = 3.2e-3
X, Y = np.meshgrid((np.arange(16) - 7.5) * PITCH, (np.arange(8) - 3.5) * PITCH)
R = np.hypot(X, Y)


def shape(pressure: np.ndarray):
    return contact_shape(X, Y, pressure.astype(float), PITCH)


def test_a_rectangle_has_its_area_axis_and_four_corners() -> None:
    found = shape((abs(X) < 0.012) & (abs(Y) < 0.006))
    assert found.active == 32
    assert found.area_m2 == pytest.approx(32 * PITCH**2)
    assert found.axis_rad == pytest.approx(0.0)
    assert found.elongation == pytest.approx(math.sqrt(63 / 15))
    assert len(found.corners_m) == 4
    assert np.abs(found.corners_m).max(axis=0) == pytest.approx((3.5 * PITCH, 1.5 * PITCH))


def test_a_triangle_has_three_corners_and_a_round_contact_many_and_no_axis() -> None:
    assert len(shape(2 * (Y / PITCH + 3.5) <= X / PITCH + 7.5).corners_m) == 3
    found = shape(R < 0.0113)
    assert math.isnan(found.axis_rad)
    assert (found.elongation, found.holes) == (1.0, 0)
    assert len(found.corners_m) > 5


def test_holes_are_what_the_contact_encloses() -> None:
    assert shape((R < 0.0113) & (R > 0.006)).holes == 1
    assert shape((R < 0.0113) & ((R > 0.006) | (abs(Y) < PITCH))).holes == 2
    open_ring = (R < 0.0113) & (R > 0.006) & ~((X > 0) & (abs(Y) < PITCH))
    assert shape(open_ring).holes == 0


@pytest.mark.parametrize("angle", [0.4, math.pi / 4, -0.7])
def test_the_axis_of_a_turned_bar_is_found(angle: float) -> None:
    along = X * math.cos(angle) + Y * math.sin(angle)
    across = -X * math.sin(angle) + Y * math.cos(angle)
    found = shape((abs(along) < 0.013) & (abs(across) < 0.004))
    assert found.axis_rad == pytest.approx(angle, abs=0.15)
    assert found.elongation > 2.0


def test_the_centroid_is_that_of_the_pressure_and_the_axis_that_of_the_area() -> None:
    bar = ((abs(X) < 0.012) & (abs(Y) < 0.003)).astype(float)
    tilted = shape(bar * (1.0 + 40.0 * (X + 0.02)))
    assert tilted.centroid_m[0] > 0.0005
    assert tilted.axis_rad == pytest.approx(0.0)
    assert tilted.elongation == pytest.approx(shape(bar).elongation)


def test_a_line_of_taxels_is_endlessly_long_and_one_is_a_point() -> None:
    along, across = abs(X) < 0.01, abs(Y - 0.5 * PITCH) < 1e-9
    for on, elongation, corners in ((along & across, math.inf, 2), (across & (abs(X - X[3, 5]) < 1e-9), 1.0, 1)):
        found = shape(on)
        assert (found.elongation, len(found.corners_m), found.holes) == (elongation, corners, 0)


def test_no_contact_has_no_shape() -> None:
    found = shape(np.zeros_like(X))
    assert (found.active, found.area_m2, found.holes, len(found.corners_m)) == (0, 0.0, 0, 0)
    assert np.isnan(found.centroid_m).all()
