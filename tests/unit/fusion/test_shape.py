"""Contact shape of images whose shape is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.fusion import contact_shape
from slipd.types.arrays import Array

PITCH = 3.2e-3
X, Y = np.meshgrid((np.arange(16) - 7.5) * PITCH, (np.arange(8) - 3.5) * PITCH)
R = np.hypot(X, Y)


def shape(pressure: np.ndarray):
    return contact_shape(X, Y, pressure.astype(float), PITCH)


RING = (R < 0.0113) & (R > 0.006)
LINE = abs(Y - 0.5 * PITCH) < 1e-9


@pytest.mark.parametrize(
    ("pressed", "active", "corners", "elongation", "axis_rad", "holes"),
    [
        ((abs(X) < 0.012) & (abs(Y) < 0.006), 32, 4, math.sqrt(63 / 15), 0.0, 0),
        (2 * (Y / PITCH + 3.5) <= X / PITCH + 7.5, 72, 3, None, None, 0),
        # round contacts have no axis; a ring encloses a hole, unless it is open
        (R < 0.0113, 32, 8, 1.0, math.nan, 0),
        (RING, 20, 8, 1.0, math.nan, 1),
        (RING | (R < 0.0113) & (abs(Y) < PITCH), 28, 8, None, None, 2),
        (RING & ~((X > 0) & (abs(Y) < PITCH)), 18, 8, None, None, 0),
        # a line of taxels is endlessly long, one taxel is a point, and none has no shape
        ((abs(X) < 0.01) & LINE, 6, 2, math.inf, 0.0, 0),
        ((abs(X - X[3, 5]) < 1e-9) & LINE, 1, 1, 1.0, math.nan, 0),
        (np.zeros_like(X), 0, 0, None, math.nan, 0),
    ],
)
def test_a_contact_has_its_area_corners_axis_and_holes(
    pressed: Array, active: int, corners: int | None, elongation: float | None, axis_rad: float | None, holes: int
) -> None:
    """None: it depends on the grid."""
    found = shape(pressed)
    assert (found.active, found.area_m2, found.holes) == (active, pytest.approx(active * PITCH**2), holes)
    assert corners in (None, len(found.corners_m))
    assert elongation is None or found.elongation == pytest.approx(elongation)
    assert axis_rad is None or found.axis_rad == pytest.approx(axis_rad, nan_ok=True)
    assert np.isnan(found.centroid_m).all() == (active == 0)


def test_the_corners_of_a_rectangle_are_those_of_its_taxels() -> None:
    corners = np.abs(shape((abs(X) < 0.012) & (abs(Y) < 0.006)).corners_m)
    assert corners == pytest.approx(np.tile((3.5 * PITCH, 1.5 * PITCH), (4, 1)))


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
    assert (tilted.axis_rad, tilted.elongation) == pytest.approx((0.0, shape(bar).elongation))
