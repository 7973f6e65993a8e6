"""The image confirms a shift of the contact centroid, and neither a tilt nor a drift of the force sensor."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.motion.image_agreement import ImageAgreement
from slipd.signals.pad import PadGeometry
from slipd.types.arrays import Array

GAPPY, FULL = PadGeometry(8, 16, 0.0032, 0.0015), PadGeometry(8, 16, 0.0032, 0.0032)
FINE_M = 2e-4
AT = FINE_M * (np.arange(256) + 0.5) - 0.0256
HIGH = FINE_M * (np.arange(128) + 0.5) - 0.0128
X, Y = np.meshgrid(AT, HIGH)
VARIANCE = np.full(128, 1e-6)

Pair = tuple[float, float]


def pressure(at_m: Pair = (0.0, 0.0), tilt: Pair = (0.0, 0.0), exponent: float = 0.3) -> Array:
    """A rounded patch of 23 by 15 mm, whose pressure has a relative slope across its half lengths."""
    u, v = (X - at_m[0]) / 0.0115, (Y - at_m[1]) / 0.0075
    inside = np.clip(1.0 - u**4 - v**4, 0.0, None)
    found = np.where(inside > 0.0, inside**exponent, 0.0) * np.clip(1.0 + tilt[0] * u + tilt[1] * v, 0.0, None)
    return found / found.sum()


def centroid(loads: Array) -> Array:
    return np.array(((loads * X).sum(), (loads * Y).sum()))


def image(loads: Array, geometry: PadGeometry, noise: float = 1e-3) -> Array:
    """Return what the electrodes feel; the loads of the taxels are about 0.3 in the middle."""
    x, y = geometry.positions()
    half = geometry.electrode_m / 2.0
    felt = [loads[np.ix_(abs(HIGH - b) < half, abs(AT - a) < half)].mean() for a, b in zip(x, y, strict=True)]
    return 2500.0 * np.array(felt) + np.random.default_rng(1).normal(0.0, noise, len(felt))


def shows(geometry: PadGeometry, before: Array, after: Array, shift_m: Array | None = None) -> bool:
    moved = centroid(after) - centroid(before) if shift_m is None else shift_m
    return ImageAgreement(geometry).shows(image(before, geometry), image(after, geometry), VARIANCE, moved)


@pytest.mark.parametrize("geometry", [GAPPY, FULL])
@pytest.mark.parametrize("angle", [0.0, 0.7, 1.6, 2.5])
def test_a_shift_is_shown(geometry: PadGeometry, angle: float) -> None:
    to = (4e-4 * math.cos(angle), 4e-4 * math.sin(angle))
    assert shows(geometry, pressure(), pressure(to))
    assert shows(geometry, pressure(tilt=(0.5, 0.3)), pressure(to, tilt=(0.5, 0.3)))


@pytest.mark.parametrize("geometry", [GAPPY, FULL])
@pytest.mark.parametrize("before", [(0.0, 0.0), (0.5, 0.0), (0.4, -0.5), (-0.8, 0.1)])
@pytest.mark.parametrize("change", [(0.12, 0.0), (0.0, 0.15), (0.1, 0.1), (-0.15, 0.1)])
def test_a_tilt_is_no_shift(geometry: PadGeometry, before: Pair, change: Pair) -> None:
    first, last = pressure(tilt=before), pressure(tilt=(before[0] + change[0], before[1] + change[1]))
    assert np.hypot(*(centroid(last) - centroid(first))) > 2e-4
    assert not shows(geometry, first, last)


def test_a_centroid_that_drifts_alone_or_another_way_is_no_shift() -> None:
    drift = np.array((4e-4, 0.0))
    assert not shows(GAPPY, pressure(), pressure(), drift)
    assert not shows(GAPPY, pressure(), pressure((-4e-4, 0.0)), drift)
    assert not shows(FULL, pressure(), 1.1 * pressure(), drift)


def test_edges_between_electrodes_show_a_part_of_a_shift() -> None:
    """Of a uniform pressure only edges that cross an electrode show anything; no tilt leaves such a change."""
    seen = [shows(GAPPY, pressure((k * 4e-4, 0.0), exponent=0.0), pressure((k * 4e-4 + 5e-4, 0.0), exponent=0.0))
            for k in range(8)]  # fmt: skip
    assert 4 <= sum(seen) < 8


def test_without_a_contact_nothing_is_shown() -> None:
    loads = image(pressure(), FULL)
    nowhere = np.full(128, math.inf)
    assert not ImageAgreement(FULL).shows(loads, loads, nowhere, np.array((4e-4, 0.0)))
    nine = nowhere.copy()
    nine[40:49] = 1e-6
    assert not ImageAgreement(FULL).shows(loads, 2.0 * loads, nine, np.array((4e-4, 0.0)))
