"""The kernels of the evidence do what they do without compilation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.motion import image_fit, vibration
from slipd.motion.image_fit import MODES
from slipd.signals.pad import PadGeometry

GEOMETRY = PadGeometry(16, 32, 0.002, 0.002)
X, Y = GEOMETRY.positions()
ALL = np.full(X.size, 1e-4)


def image(dx: float = 0.0, dy: float = 0.0) -> np.ndarray:
    return np.exp(-(((X - dx) / 0.016) ** 4) - ((Y - dy) / 0.01) ** 4)


LOADS = image()
ONE_COLUMN = PadGeometry(12, 1, 0.004, 0.003)
"""No neighbours along X."""
SMALL = PadGeometry(5, 5, 0.004, 0.003)
MIDDLE = 1.0 * (np.arange(25) == 12)
COLUMN = np.exp(-((np.arange(12.0) - 5.2) ** 4) / 90.0)


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels that call each other run without compilation too."""
    for module, names in ((image_fit, ("_fit", "_solve")), (vibration, ("_powers", "_unpredictable"))):
        for name in names:
            kernel = getattr(module, name)
            monkeypatch.setattr(module, name, getattr(kernel, "py_func", kernel))


def fit(before: np.ndarray, after: np.ndarray, variance: np.ndarray, geometry: PadGeometry) -> np.ndarray | None:
    found = image_fit.ImageFitter(geometry).fit(before, after, variance)
    if found is None:
        return None
    rest = (found.scale, found.freedom, found.radius_m, found.tilt)
    return np.concatenate((found.shift_m, found.precision.ravel(), found.growth_m, rest))


def without(taxels: int) -> np.ndarray:
    variance = ALL.copy()
    variance[:taxels] = math.inf
    return variance


IMAGES = {
    "whole": (LOADS, (1.1 + 3.0 * X) * image(4e-4, -3e-4), ALL, GEOMETRY),
    "without some taxels": (LOADS, image(2e-4, 5e-4), without(200), GEOMETRY),
    "one column": (COLUMN, 1.2 * np.roll(COLUMN, 1), np.ones(12), ONE_COLUMN),
    "dark": (np.zeros(X.size), np.zeros(X.size), ALL, GEOMETRY),
    "too few taxels": (LOADS, LOADS, without(X.size - MODES), GEOMETRY),
    "one loaded taxel": (MIDDLE, 2.0 * MIDDLE, np.ones(25), SMALL),
}
FITS = {name: fit(*images) for name, images in IMAGES.items()}
READINGS = np.random.default_rng(1).normal(0.0, 0.02, (32, 3)) + np.sin(0.9 * np.arange(32))[:, None]


def powers(readings: np.ndarray) -> np.ndarray:
    out = np.zeros(4)
    vibration._powers(readings, out)
    return out


POWERS = powers(READINGS)


@pytest.mark.parametrize("name", IMAGES)
@pytest.mark.usefixtures("plain")
def test_the_fit(name: str) -> None:
    found = fit(*IMAGES[name])
    if name in ("dark", "too few taxels", "one loaded taxel"):
        assert found is FITS[name] is None
    else:
        assert found == pytest.approx(FITS[name], rel=1e-6, abs=1e-9)


@pytest.mark.usefixtures("plain")
def test_the_powers() -> None:
    assert powers(READINGS) == pytest.approx(POWERS, rel=1e-9)
    assert powers(np.zeros((32, 3))).tolist() == [0.0, 0.0, 0.0, 1.0]
