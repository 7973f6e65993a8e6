"""Courses of the load on one contact, and the contact watch that follows them."""

from __future__ import annotations

import math

import numpy as np

from slipd.config import Levels, Slip
from slipd.fusion.assess import assess_readings
from slipd.fusion.contact_state import Assessment, ContactState, WrenchUncertainty
from slipd.fusion.rows import READING, TOUCHING, Rows, new_rows
from slipd.types.arrays import Array

MU = 0.6
NORMAL_N, STD_N = 10.0, 0.02
NOISELESS = WrenchUncertainty()


def watch(settings: Slip | None = None) -> ContactState:
    return ContactState(Levels(), settings or Slip(), 0.001, 0.3)


def contact_rows(
    count: int,
    load_n: object,
    normal_n: object,
    used: object,
    t_s: object,
    phase: int = TOUCHING,
    aside_n: object = 0.0,
) -> Rows:  # fmt: skip
    """Return readings of a contact at the pad's centre, well inside its outline, pulled askew."""
    rows = new_rows(READING, count)
    contact, utilisation = rows["contact"], rows["utilisation"]
    rows["t_s"], rows["phase"], rows["tipping_margin_m"] = t_s, phase, 0.01
    along, aside = np.asarray(load_n), np.asarray(aside_n)
    contact["normal_n"], contact["fx_n"], contact["fy_n"] = (
        normal_n,
        0.8 * along - 0.6 * aside,
        0.6 * along + 0.8 * aside,
    )
    contact["friction_ratio"] = (contact["fx_n"] ** 2 + contact["fy_n"] ** 2) ** 0.5 / contact["normal_n"]
    for name in ("value", "lower", "upper"):
        utilisation[name] = used
    return rows


def readings(
    load: Array, normal: Array | float = NORMAL_N, *, aside: Array | float = 0.0, hz: float = 1000.0,
    t_s: Array | None = None, std_n: float = STD_N, mu: float = MU, seed: int = 0, noise: Array | None = None,
) -> Rows:  # fmt: skip
    """Return readings of a course of the load, N, with noise: at a rate, or at times."""
    count = len(load)
    noise = np.random.default_rng(seed).normal(0.0, std_n, (3, count)) if noise is None else noise
    pulled, across, pressed = load + noise[0], aside + noise[1], normal + noise[2]
    used = np.hypot(pulled, across) / pressed / (1.0 if math.isnan(mu) else mu)
    times_s = 100.0 + (np.arange(count) / hz if t_s is None else t_s)
    return contact_rows(count, pulled, pressed, used, times_s, aside_n=across)


def assess(
    contact: ContactState, rows: Rows, mu: float = MU, uncertainty: WrenchUncertainty = NOISELESS, spin_1n: float = 0.0
) -> None:
    """Fill in the assessments of readings with these conditions in force."""
    contact.set_friction(mu)
    contact.set_uncertainty(uncertainty)
    assess_readings(rows, contact.row, spin_1n)


def assessed(rows: Rows, mu: float = MU, settings: Slip | None = None, size: int = 0) -> Rows:
    """Return the assessments of readings, which come together, or in reads of a size."""
    contact = watch(settings)
    for first in range(0, len(rows), size or len(rows)):
        assess(contact, rows[first : first + (size or len(rows))], mu, WrenchUncertainty(STD_N))
    return rows["assessment"]


def line(*parts: tuple[float, float, int]) -> Array:
    """Return lines one after another: from, to, readings."""
    return np.concatenate([np.linspace(a, b, n) for a, b, n in parts])


def slips_at(found: Rows) -> list[int]:
    """Return the readings at which a slip begins."""
    slips = found["slips"]
    return (np.flatnonzero(slips & ~np.concatenate(([False], slips[:-1])))).tolist()


class Watch:
    """A contact whose readings come one by one, at 1 kHz."""

    def __init__(self) -> None:
        self.watch = watch()
        self.k = 0

    def take(self, load_n: float, normal_n: float, used: float, *, phase: int = TOUCHING) -> Assessment:
        """Take a reading."""
        row = contact_rows(1, load_n, normal_n, used, self.k * 1e-3, phase)
        self.k += 1
        assess(self.watch, row)
        return Assessment(*row["assessment"].item(0))

    def step(self, used: float) -> int:
        """Return the step of a utilisation."""
        return self.take(1.0, 10.0, used).friction_step
