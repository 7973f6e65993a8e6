"""The true contact of one pad: where the object presses, what the taxels feel of it, what friction carries.

Everything in the pad's plane is told in the pad frame of the *left* finger. The right finger is the same
hardware turned half a turn about the gripper's approach axis, so it sees the mirror image: y and the spin change
sign, x does not.

The patch belongs to the pad, as with a crowned rubber pad against a flat box: it neither moves with the object
nor grows with the force, and its pressure keeps its shape. No tipping and no edges of the object.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slipd.fusion import utilisation

Array = NDArray[np.float64]

Load = tuple[float, float, float]
"""Tangential force along x and y, N, and spin torque about the contact's centre, N·m."""

ELECTRODE_SAMPLES = 7
"""Points across an electrode when its mean pressure is taken; 7 by 7 are within 0.5 % of the integral."""


@dataclass(frozen=True)
class Patch:
    """A contact patch: |x/a|^n + |y/b|^n ≤ 1 about its centre, pressure falling smoothly to zero at the rim.

    Attributes:
        half_length_m: a, along the pad's x.
        half_width_m: b, along the pad's y.
        exponent: n; 2 is an ellipse (then the pressure is Hertz's), 4 a rounded rectangle.
        centre_m: Centre in the left pad's frame, which is also the centroid of the pressure.
    """

    half_length_m: float = 0.018
    half_width_m: float = 0.009
    exponent: float = 4.0
    centre_m: tuple[float, float] = (0.002, -0.001)

    def pressure(self, x_m: ArrayLike, y_m: ArrayLike) -> Array:
        """Relative pressure, 1 at the centre and 0 outside, at points of the left pad's frame."""
        u = np.abs((np.asarray(x_m, dtype=float) - self.centre_m[0]) / self.half_length_m)
        v = np.abs((np.asarray(y_m, dtype=float) - self.centre_m[1]) / self.half_width_m)
        rest = np.clip(1.0 - u**self.exponent - v**self.exponent, 0.0, None)
        return np.asarray(rest**0.5, dtype=np.float64)

    def mirrored(self) -> Patch:
        """The same contact as the right pad sees it."""
        x, y = self.centre_m
        return Patch(self.half_length_m, self.half_width_m, self.exponent, (x, -y))

    def cells(self, cell_m: float) -> tuple[Array, Array, Array]:
        """The patch cut into square cells about its centre.

        Args:
            cell_m: Largest side of a cell.

        Returns:
            x, y of the cells' middles in the left pad's frame, m; their shares of the normal force, Σ = 1.
        """
        x, y = np.meshgrid(_middles(self.half_length_m, cell_m), _middles(self.half_width_m, cell_m))
        x, y = x.ravel() + self.centre_m[0], y.ravel() + self.centre_m[1]
        pressure = self.pressure(x, y)
        inside = pressure > 0.0
        return x[inside], y[inside], pressure[inside] / pressure[inside].sum()


def _middles(half_m: float, cell_m: float) -> Array:
    n = 2 * math.ceil(half_m / cell_m)
    return np.asarray((np.arange(n) - (n - 1) / 2) * (2 * half_m / n), dtype=np.float64)


@dataclass(frozen=True)
class Pad:
    """The taxels of a pad: row by row, columns along x, the first taxel at the least x and y.

    Attributes:
        rows: Along y.
        cols: Along x.
        pitch_m: Centre to centre.
        electrode_m: Diameter of the round electrode that a taxel senses with.
    """

    rows: int = 8
    cols: int = 16
    pitch_m: float = 0.0032
    electrode_m: float = 0.0015

    def centres(self) -> tuple[Array, Array]:
        """Centres of the taxels in the pad frame, x and y in scan order, shapes (rows * cols,), m."""
        x, y = np.meshgrid(
            (np.arange(self.cols) - (self.cols - 1) / 2) * self.pitch_m,
            (np.arange(self.rows) - (self.rows - 1) / 2) * self.pitch_m,
        )
        return x.ravel(), y.ravel()

    def shares(self, patch: Patch) -> Array:
        """What each taxel reads per newton of normal force, shape (taxels,).

        That is the mean pressure on its electrode times the area of its cell. The sum is near 1 and not 1: the
        gaps between the electrodes feel nothing.
        """
        offset = (np.arange(ELECTRODE_SAMPLES) - (ELECTRODE_SAMPLES - 1) / 2) / ELECTRODE_SAMPLES
        dx, dy = (self.electrode_m * grid.ravel() for grid in np.meshgrid(offset, offset))
        round_ = np.hypot(dx, dy) <= self.electrode_m / 2
        x, y = self.centres()
        mean = patch.pressure(x[:, None] + dx[round_], y[:, None] + dy[round_]).mean(axis=1)
        return np.asarray(mean * (self.pitch_m**2 / _volume(patch)))


def _volume(patch: Patch) -> float:
    """Integral of the relative pressure over the patch, m²."""
    cell = min(patch.half_length_m, patch.half_width_m) / 100
    x, y = _middles(patch.half_length_m, cell), _middles(patch.half_width_m, cell)
    pressure = patch.pressure(x[None, :] + patch.centre_m[0], y[:, None] + patch.centre_m[1])
    return float(pressure.mean() * 4 * patch.half_length_m * patch.half_width_m)


@dataclass(frozen=True, slots=True)
class Need:
    """What friction needs to carry a load on one pad, and how the object moves where it has less.

    Attributes:
        normal_n: Least normal force, N; over the normal force that there is, it is the true utilisation λ.
        twist: Velocity of the contact's centre and spin rate of the motion that would begin, to scale.
    """

    normal_n: float
    twist: Load


class FrictionLimit:
    """What friction on a patch carries: the limit surface on a grid of the true contact.

    Args:
        patch: The contact.
        cell_m: Side of the grid's cells; 2 mm put a spin limit within 0.5 % of the continuous contact's.
    """

    def __init__(self, patch: Patch, cell_m: float = 0.002) -> None:
        self._x, self._y, self._shares = patch.cells(cell_m)
        self._about = np.array(patch.centre_m)

    def need(self, load: Load, mu: float) -> Need:
        """What ``load`` on one pad, told about the contact's centre, needs at friction coefficient ``mu``."""
        fx, fy, spin = load
        if fx == 0.0 and fy == 0.0 and spin == 0.0:
            return Need(0.0, (0.0, 0.0, 0.0))
        found = utilisation(self._x, self._y, self._shares, mu, np.array([fx, fy]), spin, self._about)
        if found.pole_m is None:
            return Need(found.value, (fx, fy, 0.0))
        x, y = self._about - found.pole_m
        sense = math.copysign(1.0, fy * x - fx * y + spin)  # the load drives the motion: its power is positive
        return Need(found.value, (-sense * float(y), sense * float(x), sense))


def finger_load(load: Load, *, right: bool) -> Load:
    """One finger's half of a load told in the left pad's frame, in that finger's own pad frame."""
    fx, fy, spin = load[0] / 2, load[1] / 2, load[2] / 2
    return (fx, -fy, -spin) if right else (fx, fy, spin)


def pad_wrench(load: Load, normal_n: float, centre_m: tuple[float, float]) -> tuple[Array, Array]:
    """Force and torque on a finger by the object, in its pad frame: paper eqs. (1)–(3) backwards.

    Args:
        load: What this finger's friction carries, in its own pad frame.
        normal_n: Normal force, N.
        centre_m: Centroid of this finger's contact in its own pad frame, m.

    Returns:
        Force (3,), N, with F_z = −normal; torque about the pad's centre (3,), N·m.
    """
    fx, fy, spin = load
    cx, cy = centre_m
    force = np.array([fx, fy, -normal_n])
    return force, np.array([-cy * normal_n, cx * normal_n, cx * fy - cy * fx + spin])
