"""Faults of a program that sends the arm's motion."""

from __future__ import annotations

import numpy as np
from carry.weigh import Distortion

from slipd.types.arrays import Array

G_MPS2 = 9.80665


def _axes(matrix: Array) -> Distortion:
    return lambda gravity, omega, alpha: (gravity @ matrix.T, omega @ matrix.T, alpha @ matrix.T)


def _late(gravity: Array, omega: Array, alpha: Array) -> tuple[Array, Array, Array]:
    steps = 13  # of 4 ms
    return tuple(
        np.concatenate((np.repeat(each[:1], steps, axis=0), each[:-steps])) for each in (gravity, omega, alpha)
    )  # type: ignore[return-value]


def _half_lost(gravity: Array, omega: Array, alpha: Array) -> tuple[Array, Array, Array]:
    """Lose 100 ms of every 200: rows of NaN are not sent."""
    lost = np.arange(len(gravity)) // 25 % 2 > 0
    return np.where(lost[:, None], np.nan, gravity), omega, alpha


def _lost(gravity: Array, omega: Array, alpha: Array) -> tuple[Array, Array, Array]:
    """Lose the second half: a lift is under way."""
    lost = np.arange(len(gravity)) > len(gravity) // 2
    return np.where(lost[:, None], np.nan, gravity), omega, alpha


FAULTS: dict[str, tuple[Distortion | None, str]] = {
    "none": (None, ""),
    "sign": (lambda gravity, omega, alpha: (-gravity, omega, alpha), "sign"),
    "axes swapped": (_axes(np.eye(3)[[1, 0, 2]]), "frame"),
    "turned by 90 degrees": (_axes(np.array(((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))), "frame"),
    "10 % more": (lambda gravity, omega, alpha: (1.1 * gravity, omega, alpha), "length"),
    "50 ms late": (_late, "late"),
    "in g": (lambda gravity, omega, alpha: (gravity / G_MPS2, omega, alpha), "length"),
    "lost": (_lost, "no reading"),
}
"""Faults of a sender, and the word by which ``status`` names each."""

MORE_FAULTS: dict[str, Distortion] = {"half of it lost": _half_lost}
"""Faults that are not found by the load."""
