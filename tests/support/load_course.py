"""Courses of the load on one contact, and the contact watch that follows them."""

from __future__ import annotations

import numpy as np

from slipd.config import Levels, Slip
from slipd.fusion.levels import Assessment, ContactWatch, Uncertainty
from slipd.fusion.rows import READING, TOUCHING, Rows, new_rows
from slipd.types.arrays import Array

MU = 0.6


def contact_rows(
    count: int,
    load_n: object,
    normal_n: object,
    used: object,
    t_s: object,
    phase: int = TOUCHING,
    aside_n: object = 0.0,
) -> Rows:  # fmt: skip
    """Return readings of a contact at the pad's centre, well inside its outline, pulled along X and Y."""
    rows = new_rows(READING, count)
    contact, utilisation = rows["contact"], rows["utilisation"]
    rows["t_s"], rows["phase"], rows["tipping_margin_m"] = t_s, phase, 0.01
    contact["normal_n"], contact["fx_n"], contact["fy_n"] = normal_n, load_n, aside_n
    contact["friction_ratio"] = (contact["fx_n"] ** 2 + contact["fy_n"] ** 2) ** 0.5 / contact["normal_n"]
    for name in ("value", "lower", "upper"):
        utilisation[name] = used
    return rows


def line(*parts: tuple[float, float, int]) -> Array:
    """Return lines one after another: from, to, readings."""
    return np.concatenate([np.linspace(a, b, n) for a, b, n in parts])


def slips_at(found: Rows) -> list[int]:
    """Return the readings at which a slip begins."""
    slips = found["slips"]
    return (np.flatnonzero(slips & ~np.concatenate(([False], slips[:-1])))).tolist()


class Watch:
    """A contact whose readings come one by one, at 1 kHz."""

    def __init__(self, settings: Slip | None = None) -> None:
        self.watch = ContactWatch(Levels(), settings or Slip(), 0.001, 0.3)
        self.k = 0

    def take(self, load_n: float, normal_n: float, used: float, *, phase: int = TOUCHING) -> Assessment:
        """Take a reading."""
        row = contact_rows(1, load_n, normal_n, used, self.k * 1e-3, phase)
        self.k += 1
        self.watch.assess(row, MU, Uncertainty(), 0.0)
        return Assessment(*row["assessment"].item(0))

    def step(self, used: float) -> int:
        """Return the step of a utilisation."""
        return self.take(1.0, 10.0, used).friction_step
