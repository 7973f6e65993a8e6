"""Two images show a motion of the contact apart from a change of its load, and a shift apart from a tilt."""

from __future__ import annotations

import math

import numpy as np
import pytest
from plain_kernels import run_without_compilation

from slipd.motion import image_fit
from slipd.motion.image_blocks import Block
from slipd.motion.image_fit import MODES, ImageComparison
from slipd.signals.pad import PadGeometry
from slipd.types.arrays import Array, Mask

GAPPY, FULL = PadGeometry(8, 16, 0.0032, 0.0015), PadGeometry(8, 16, 0.0032, 0.0032)
FINE_M = 2e-4
AT, HIGH = FINE_M * (np.arange(256) + 0.5) - 0.0256, FINE_M * (np.arange(128) + 0.5) - 0.0128
X, Y = np.meshgrid(AT, HIGH)

Pair = tuple[float, float]


def block(image: Array, normal_n: float = 10.0, usable: Mask | None = None) -> Block:
    load = np.array((1.0, 0.0, normal_n, 0.0, 0.0, 0.0))
    return Block(0, image, np.full(image.size, 5e-7), load, np.ones(6), 0.1, np.zeros((1, 6)), usable)


def pressure(at_m: Pair = (0.0, 0.0), tilt: Pair = (0.0, 0.0), exponent: float = 0.3) -> Array:
    """A rounded patch of 23 by 15 mm, whose pressure has a relative slope across its half lengths."""
    u, v = (X - at_m[0]) / 0.0115, (Y - at_m[1]) / 0.0075
    inside = np.clip(1.0 - u**4 - v**4, 0.0, None)
    found = np.where(inside > 0.0, inside**exponent, 0.0) * np.clip(1.0 + tilt[0] * u + tilt[1] * v, 0.0, None)
    return np.asarray(found / found.sum())


def centroid(loads: Array) -> Array:
    return np.array(((loads * X).sum(), (loads * Y).sum()))


def image(loads: Array, geometry: PadGeometry) -> Array:
    """Return what the electrodes feel; the loads of the taxels are about 0.3 in the middle."""
    half = geometry.electrode_m / 2.0
    places = zip(*geometry.positions(), strict=True)
    felt = [loads[np.ix_(abs(HIGH - b) < half, abs(AT - a) < half)].mean() for a, b in places]
    return 2500.0 * np.array(felt) + np.random.default_rng(1).normal(0.0, 1e-3, len(felt))


def shows(geometry: PadGeometry, before: Array, after: Array, shift_m: Array | None = None) -> bool:
    moved = centroid(after) - centroid(before) if shift_m is None else shift_m
    return ImageComparison(geometry).shows_shift(block(image(before, geometry)), block(image(after, geometry)), moved)


@pytest.mark.parametrize("geometry", [GAPPY, FULL])
def test_a_shift_is_shown_and_a_tilt_is_none(geometry: PadGeometry) -> None:
    for angle in (0.0, 0.7, 1.6, 2.5):
        to = 4e-4 * math.cos(angle), 4e-4 * math.sin(angle)
        for tilt in ((0.0, 0.0), (0.5, 0.3)):
            assert shows(geometry, pressure(tilt=tilt), pressure(to, tilt))
    for before in ((0.0, 0.0), (0.5, 0.0), (0.4, -0.5), (-0.8, 0.1)):
        for change in ((0.12, 0.0), (0.0, 0.15), (0.1, 0.1), (-0.15, 0.1)):
            first, last = pressure(tilt=before), pressure(tilt=(before[0] + change[0], before[1] + change[1]))
            assert np.hypot(*(centroid(last) - centroid(first))) > 2e-4
            assert not shows(geometry, first, last)


def test_a_centroid_that_drifts_alone_or_another_way_is_no_shift() -> None:
    drift = np.array((4e-4, 0.0))
    for after in (pressure(), pressure((-4e-4, 0.0)), 1.1 * pressure()):
        assert not shows(GAPPY, pressure(), after, drift)


def test_edges_between_electrodes_show_a_part_of_a_shift() -> None:
    """Of a uniform pressure only edges that cross an electrode show anything; no tilt leaves such a change."""
    places = [pressure((k * 1e-4, 0.0), exponent=0.0) for k in range(34)]
    assert 4 <= sum(shows(GAPPY, places[4 * k], places[4 * k + 5]) for k in range(8)) < 8


@pytest.mark.parametrize("turned", [{}, {"swap_xy": True, "flip_x": True, "flip_y": True}])
def test_a_fit_finds_shift_and_turn_beside_gain_and_tilt(turned: dict[str, bool]) -> None:
    fine = PadGeometry(24, 24, 0.002, 0.002, **turned)
    x, y = fine.positions()

    def patch(dx: float, dy: float, turn: float) -> Array:
        u, v = x - dx, y - dy
        u, v = u * math.cos(turn) + v * math.sin(turn), v * math.cos(turn) - u * math.sin(turn)
        return np.asarray(np.exp(-((u / 0.014) ** 4) - (v / 0.009) ** 4))

    after = patch(4e-4, -3e-4, 0.03) * (1.1 + 5.0 * x - 8.0 * y)
    fit = ImageComparison(fine).fit(block(patch(0.0, 0.0, 0.0)), block(after))
    assert fit.shift_m[:2] == pytest.approx([4e-4, -3e-4], abs=4e-5)
    assert fit.shift_m[2] / fit.radius_m == pytest.approx(0.03, abs=0.004)
    assert fit.tilt == pytest.approx(fit.radius_m * math.hypot(5.0, 8.0), rel=0.2)


def test_too_few_taxels_or_no_load_show_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    run_without_compilation(monkeypatch, image_fit)
    images = ImageComparison(PadGeometry(4, 4, 0.004, 0.002))
    few = np.arange(16) < MODES
    assert images.fit(block(np.zeros(16)), block(np.zeros(16))) is None
    assert images.fit(block(np.ones(16)), block(np.ones(16), usable=few)) is None
    assert not images.shows_shift(block(np.ones(16)), block(np.arange(16.0), usable=few), np.array((4e-4, 0.0)))
    one = 1.0 * (np.arange(16) == 5)
    assert images.fit(block(one), block(2.0 * one)) is None


def test_a_fit_on_a_pad_of_one_column_knows_nothing_of_the_other_direction() -> None:
    column = np.exp(-((np.arange(12.0) - 5.2) ** 4) / 90.0)
    fit = ImageComparison(PadGeometry(12, 1, 0.004, 0.003)).fit(block(column), block(1.2 * np.roll(column, 1)))
    assert abs(fit.shift_m[0]) < 1e-12
    assert fit.precision[0, 0] < 1e-200
    assert fit.shift_m[1] > 0.001


def test_growth_is_no_more_than_a_sphere_allows_but_for_a_gap_that_opens() -> None:
    images = ImageComparison(FULL)
    flat, tilted = (block(image(pressure(tilt=tilt), FULL), 10.0) for tilt in ((0.0, 0.0), (0.9, 0.0)))
    grown = block(image(1.1 * pressure(), FULL), 11.0)
    fit = images.fit(flat, grown)
    wide = fit._replace(growth_m=(1.0, 1.0))
    assert images.growth_m(wide, flat, grown) == pytest.approx([fit.radius_m / 33.0] * 2)
    assert images.growth_m(fit, flat, grown) <= (fit.growth_m[0], fit.growth_m[1])
    assert images.growth_m(wide, tilted, flat) == (1.0, 0.0)
