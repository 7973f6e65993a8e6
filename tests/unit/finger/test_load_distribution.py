"""Load distribution of an image under each load rule, and how far its few taxels put the required friction off."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slipd.finger.contact_estimator import SHAPE_ERROR
from slipd.finger.finger_state import LoadDistribution, distribute
from slipd.fusion import Contact, contact_from_wrench, torque_limit

X, Y = (axis.ravel() for axis in np.meshgrid(0.004 * np.arange(4.0) - 0.006, 0.004 * np.arange(4.0) - 0.006))
RAMP = np.arange(16.0) * 0.1
EVEN = np.where(RAMP > 0.0, 1.0, 0.0)
CENTROID = (0.001, 0.0005)


def contact(normal_n: float = 8.0, centroid_m: tuple[float, float] = CENTROID) -> Contact:
    force = np.array((0.0, 0.0, -normal_n))
    return contact_from_wrench(force, np.cross((*centroid_m, 0.0), force))


def distributed(rule: str, pressure: np.ndarray, pressed: Contact) -> LoadDistribution:
    return distribute(rule, X, Y, pressure, pressed)


@pytest.mark.parametrize("rule", ["grey", "binary", "matched"])
@pytest.mark.parametrize("normal_n", [8.0, 2.0])
def test_distribution_is_that_of_1_n_on_the_active_taxels(rule: str, normal_n: float) -> None:
    found = distributed(rule, RAMP, contact(normal_n))
    loads = found.shares
    assert found.x.shape == found.y.shape == loads.shape == (15,), "the taxel without pressure carries nothing"
    assert loads.sum() == pytest.approx(1.0)
    assert (loads >= 0.0).all()


@pytest.mark.parametrize("rule", ["grey", "binary", "matched"])
def test_each_rule_uses_what_it_says_of_pressure_and_centroid(rule: str) -> None:
    found = distributed(rule, RAMP, contact())
    centroid = found.x @ found.shares, found.y @ found.shares
    assert (centroid == pytest.approx(CENTROID, abs=1e-9)) is (rule != "grey")
    by_pressure, even = RAMP[1:] / RAMP.sum(), distributed(rule, EVEN, contact()).shares
    assert (found.shares == pytest.approx(by_pressure)) is (rule == "grey")
    assert (found.shares == pytest.approx(even, rel=0.01)) is (rule == "binary")
    unknown = contact()._replace(cx_m=np.nan, cy_m=np.nan)
    assert distributed(rule, RAMP, unknown).shares == pytest.approx(by_pressure)
    assert distribute(rule, X, Y, np.zeros(16), contact()) is None


def test_a_spin_requires_friction_by_the_lever_of_its_load() -> None:
    pressed = contact()._replace(spin_nm=-0.004)
    found = distributed("grey", RAMP, pressed)
    lever_m = found.shares @ np.hypot(found.x - CENTROID[0], found.y - CENTROID[1])
    assert found.spin_required(pressed) == pytest.approx(-0.004 / (8.0 * lever_m))
    point = distributed("grey", np.where(np.arange(16) == 5, 1.0, 0.0), pressed)
    assert point.spin_required(pressed._replace(cx_m=float(X[5]), cy_m=float(Y[5]))) == 0.0


FINE = (np.arange(120) - 59.5) / 10.0
"""Positions of the true contact, in pitches of the pad of 12 × 12 taxels."""


def test_error_of_the_spin_by_few_taxels_is_within_the_stated_deviation() -> None:
    """Elliptical contacts from flat to parabolic, anywhere on the pad; a taxel shows the mean pressure of its cell."""
    rng = np.random.default_rng(8)
    products = []
    for _ in range(200):
        radius, ratio, turn, power = rng.uniform(0.8, 2.6), rng.uniform(0.6, 1.6), rng.uniform(0.0, 3.1), rng.uniform()
        x, y = np.meshgrid(FINE - rng.uniform(-0.5, 0.5), FINE - rng.uniform(-0.5, 0.5))
        along, across = x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn)
        inside = np.maximum(1.0 - (along / radius) ** 2 - (across / (ratio * radius)) ** 2, 0.0)
        true = np.where(inside > 0.0, inside**power, 0.0)
        seen = true.reshape(12, 10, 12, 10).mean(axis=(1, 3))
        seen = np.where(seen > 0.05 * seen.max(), seen, 0.0)
        centre = (float((true * x).sum() / true.sum()), float((true * y).sum() / true.sum()))
        tx, ty = x[0].reshape(12, 10).mean(axis=1), y[:, 0].reshape(12, 10).mean(axis=1)
        limit = limit_nm(*np.meshgrid(tx, ty), seen, centre) / limit_nm(x, y, true, centre)
        products.append(np.count_nonzero(seen) * (limit - 1.0))
    assert math.sqrt(np.square(products).mean()) <= SHAPE_ERROR


def limit_nm(x: np.ndarray, y: np.ndarray, pressure: np.ndarray, centre: tuple[float, float]) -> float:
    """Torque about the centre that friction carries at μ = 1 and 1 N."""
    pressed = pressure > 0.0
    loads = pressure[pressed] / pressure.sum()
    return torque_limit(x[pressed], y[pressed], loads, 1.0, (0.0, 0.0), centre, gap=1e-4).torque_nm
