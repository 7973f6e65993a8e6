"""How far the few taxels of an image put the required friction of a spin off."""

from __future__ import annotations

import math

import numpy as np

from slipd.finger.contact_estimator import SHAPE_ERROR
from slipd.fusion import torque_limit

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
