"""The 25-digit reference against contacts with a closed-form answer."""

from __future__ import annotations

import math

import numpy as np
import pytest
from chart.reference import exact_limit, exact_utilisation
from chart.scenes import FAMILIES, Scene, draw

MU = 0.5


def contact(
    x: object, y: object, loads: object, force: tuple[float, float] = (0.0, 0.0), *, scale: float = 1.0
) -> Scene:
    """Torques about the origin; ``scale`` stretches lengths."""
    xs, ys, fs = (np.asarray(a, float) for a in (x, y, loads))
    return Scene("known", xs * scale, ys * scale, fs, MU, np.array(force), np.zeros(2))


def ring(count: int, radius: float, load: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    angle = 2.0 * math.pi * (np.arange(count) + 0.5) / count
    return radius * np.cos(angle), radius * np.sin(angle), np.full(count, load / count)


def disc() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Uniform, radius 1, load 1: rings at Gauss's radii, which integrate r² exactly."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    rings = [ring(24, r, w * r) for r, w in zip((nodes + 1.0) / 2.0, weights, strict=True)]
    x, y, loads = (np.concatenate(parts) for parts in zip(*rings, strict=True))
    return x, y, loads


@pytest.mark.parametrize("radius", [1e-6, 4e-3, 1e3])
def test_a_ring_turns_about_its_middle(radius: float) -> None:
    scene = contact(*ring(16, radius, 3.0))
    assert exact_limit(scene) == pytest.approx(MU * 3.0 * radius, rel=1e-15)
    assert exact_utilisation(scene, -0.6 * radius) == pytest.approx(0.4, rel=1e-15)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.96])
def test_two_points_carry_what_statics_gives(share: float) -> None:
    force = share * MU * 2.0
    along, across = (contact((-1.0, 1.0), (0.0, 0.0), (1.0, 1.0), f) for f in ((force, 0.0), (0.0, force)))
    assert exact_limit(along) == pytest.approx(math.sqrt((1.0 - share) * (1.0 + share)), rel=4e-16, abs=0.0)
    assert exact_limit(across) == pytest.approx(1.0 - share, rel=2e-16, abs=0.0)


@pytest.mark.parametrize("share", [0.0, 0.7, 1.0])
def test_a_taxel_that_carries_the_force_alone_is_the_pole(share: float) -> None:
    x, y, loads = ring(12, 2.0, 6.0)
    force = share * MU * 5.0
    scene = contact(np.append(x, 0.0), np.append(y, 0.0), np.append(loads, 5.0), (0.6 * force, -0.8 * force))
    assert exact_limit(scene) == pytest.approx(MU * 6.0 * 2.0, rel=1e-15)


def test_an_obtuse_triangle_turns_about_its_obtuse_corner() -> None:
    x, y = (0.0, 1.0, -2.0), (0.0, 0.25, 0.5)
    expected = MU * 3.0 * (math.hypot(1.0, 0.25) + math.hypot(2.0, 0.5))
    assert exact_limit(contact(x, y, (3.0, 3.0, 3.0))) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(("ratio", "limit"), [(0.2, 0.647), (0.5, 0.539), (0.9, 0.228)])
def test_a_disc_under_a_force_has_the_known_limits(ratio: float, limit: float) -> None:
    x, y, loads = disc()
    force = (0.0, ratio * MU * math.fsum(loads))
    assert exact_limit(contact(x, y, loads, force)) / MU == pytest.approx(limit, abs=1.5e-3)


def test_a_disc_without_force_carries_two_thirds() -> None:
    assert exact_limit(contact(*disc())) / MU == pytest.approx(2.0 / 3.0, rel=1e-14)


@pytest.mark.parametrize("digits", [3, 8, 14])
def test_two_points_at_the_verge_of_translation_keep_every_digit(digits: int) -> None:
    force = 1.0 - 10.0**-digits
    scene = contact((-1.0, 1.0), (0.0, 0.0), (1.0, 1.0), (force, 0.0))
    assert exact_limit(scene) == pytest.approx(math.sqrt((1.0 - force) * (1.0 + force)), rel=4e-16, abs=0.0)


def test_the_limit_ends_where_the_force_leaves_the_friction_circle() -> None:
    x, y, loads = (0.0, 2.0, 1.0, -1.0), (1.0, 0.0, 3.0, -2.0), (1.0, 2.0, 3.0, 4.0)
    force = np.array((3.0, 4.0))  # μ Σ F = 5
    share = np.array(loads) / 10.0
    infimum = float(share @ (np.array(x) * force[1] - np.array(y) * force[0]))
    assert exact_limit(contact(x, y, loads, (3.0, 4.0))) == pytest.approx(infimum, rel=1e-15)
    assert exact_limit(contact(x, y, loads, (2.9999999999999996, 4.0))) == pytest.approx(infimum, abs=1e-6)
    assert math.isnan(exact_limit(contact(x, y, loads, (3.0000000000000004, 4.0))))


def test_one_taxel_resists_no_torque_about_itself() -> None:
    scene = contact((2.0, 2.0), (0.0, 0.0), (1.0, 3.0), (0.0, 1.0))
    assert exact_limit(scene) == 2.0
    assert exact_utilisation(scene, 2.0) == 0.5
    assert exact_utilisation(scene, 2.1) == math.inf
    assert exact_utilisation(contact(2.0, 0.0, 1.0), 0.0) == 0.0


@pytest.mark.parametrize("family", list(FAMILIES))
def test_utilisation_is_one_at_the_limit_and_grows_with_the_load(family: str) -> None:
    scene = draw(30 + list(FAMILIES).index(family))
    spin = exact_limit(scene)
    at_limit = exact_utilisation(scene, spin)
    assert at_limit == pytest.approx(1.0, abs=1e-15)  # the limit is rounded to a double
    doubled = Scene(family, scene.x, scene.y, scene.loads, MU, 2.0 * scene.tangential, scene.about)
    assert exact_utilisation(doubled, 2.0 * spin) == pytest.approx(2.0 * at_limit, rel=2e-16)
