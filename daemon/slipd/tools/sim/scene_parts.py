"""The true contact of one pad: its pressure, the readings of the taxels, and the friction limit.

All coordinates are in the pad frame of the *left* finger. The right finger is the same hardware, rotated by half a turn
about the approach axis of the gripper, so it sees the mirror image: y and the spin change sign, x does not.

The patch belongs to the pad, as with a crowned rubber pad against a flat box: it neither moves with the object nor
grows with the force, and its pressure keeps its shape. There is no tipping, and the object has no edges.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from slipd.fusion import utilisation
from slipd.signals.pad import PadGeometry
from slipd.types.arrays import Array

Load = tuple[float, float, float]
"""Tangential force along x and y, N, and spin torque about the centre of the contact, N·m."""

ELECTRODE_SAMPLES = 7
"""Points across an electrode for its mean pressure; 7 by 7 are within 0.5 % of the integral."""


@dataclass(frozen=True)
class Patch:
    """A contact patch: |x/a|^n + |y/b|^n ≤ 1 about its centre, pressure falling smoothly to zero at the rim.

    Attributes:
        half_length_m: a, along the pad's x.
        half_width_m: b, along the pad's y.
        exponent: n; 2 is an ellipse with Hertzian pressure, 4 a rounded rectangle.
        centre_m: Centre in the frame of the left pad, m; also the centroid of the pressure.
    """

    half_length_m: float = 0.018
    half_width_m: float = 0.009
    exponent: float = 4.0
    centre_m: tuple[float, float] = (0.002, -0.001)

    def pressure(self, x_m: ArrayLike, y_m: ArrayLike) -> Array:
        """Relative pressure, 1 at the centre and 0 outside, at points in the frame of the left pad."""
        u = np.abs((np.asarray(x_m, dtype=float) - self.centre_m[0]) / self.half_length_m)
        v = np.abs((np.asarray(y_m, dtype=float) - self.centre_m[1]) / self.half_width_m)
        rest = np.clip(1.0 - u**self.exponent - v**self.exponent, 0.0, None)
        return np.asarray(rest**0.5, dtype=np.float64)

    def mirrored(self) -> Patch:
        """Return the same contact in the frame of the right pad."""
        x, y = self.centre_m
        return Patch(self.half_length_m, self.half_width_m, self.exponent, (x, -y))

    def cells(self, cell_m: float) -> tuple[Array, Array, float]:
        """Divide the patch into equal cells.

        Args:
            cell_m: Largest side of a cell, m.

        Returns:
            Centres of the cells in the frame of the left pad, shape (2, n), m; their shares of the normal force, Σ = 1;
            the area of a cell, m².
        """
        grid = np.meshgrid(_middles(self.half_length_m, cell_m), _middles(self.half_width_m, cell_m))
        places = np.stack(grid).reshape(2, -1) + np.array(self.centre_m)[:, None]
        pressure = self.pressure(*places)
        inside = pressure > 0.0
        area_m2 = 4.0 * self.half_length_m * self.half_width_m / pressure.size
        return places[:, inside], pressure[inside] / pressure[inside].sum(), area_m2


def _middles(half_m: float, cell_m: float) -> Array:
    n = 2 * math.ceil(half_m / cell_m)
    return np.asarray((np.arange(n) - (n - 1) / 2) * (2 * half_m / n), dtype=np.float64)


@dataclass(frozen=True)
class Pad(PadGeometry):
    """The taxels of a pad, by default that of the demo: columns along x, the first taxel at the smallest x and y.

    Attributes:
        rows: Number of rows, along y.
        cols: Number of columns, along x.
        pitch_m: Distance between the centres of neighbouring taxels, m.
        electrode_m: Diameter of the round electrode of a taxel, m.
    """

    rows: int = 8
    cols: int = 16
    pitch_m: float = 0.0032
    electrode_m: float = 0.0015

    def shares(self, patch: Patch) -> Array:
        """Return the reading of each taxel per newton of normal force, shape (taxels,).

        It is the mean pressure on the electrode times the area of the cell. The sum is only near 1, because the gaps
        between the electrodes sense nothing.
        """
        mean = patch.pressure(*electrode_points(self)).mean(axis=1)
        return np.asarray(mean * (self.pitch_m**2 / _volume(patch)))


@functools.lru_cache(maxsize=8)
def electrode_points(pad: Pad) -> Array:
    """Return points across the electrode of every taxel, shape (2, taxels, points), m, in the frame of their pad."""
    offset = (np.arange(ELECTRODE_SAMPLES) - (ELECTRODE_SAMPLES - 1) / 2) / ELECTRODE_SAMPLES * pad.electrode_m
    dx, dy = (grid.ravel() for grid in np.meshgrid(offset, offset))
    round_ = np.hypot(dx, dy) <= pad.electrode_m / 2
    x, y = pad.positions()
    return np.ascontiguousarray(np.stack((x[:, None] + dx[round_], y[:, None] + dy[round_])))


def _volume(patch: Patch) -> float:
    """Return the integral of the relative pressure over the patch, m²."""
    cell = min(patch.half_length_m, patch.half_width_m) / 100
    x, y = _middles(patch.half_length_m, cell), _middles(patch.half_width_m, cell)
    pressure = patch.pressure(x[None, :] + patch.centre_m[0], y[:, None] + patch.centre_m[1])
    return float(pressure.mean() * 4 * patch.half_length_m * patch.half_width_m)


class FrictionLimit:
    """The friction limit of a patch: the limit surface on a grid of the true contact.

    Args:
        patch: The contact.
        cell_m: Side of a cell of the grid, m; with 2 mm the spin limit is within 0.5 % of the continuous contact.

    Attributes:
        cells: Centres of the cells of the grid, as of `Patch.cells`.
        shares: Their shares of the normal force.
        area_m2: Area of a cell.
        gyration_m: Radius of gyration of the normal force about the centre of the patch, m.
    """

    def __init__(self, patch: Patch, cell_m: float = 0.002) -> None:
        self.cells, self.shares, self.area_m2 = patch.cells(cell_m)
        self._about = np.array(patch.centre_m)
        away_m = np.hypot(*(self.cells - self._about[:, None]))
        self.gyration_m = math.sqrt(float(self.shares @ away_m**2))

    def need_n(self, load: Load, mu: float) -> float:
        """Return the normal force that ``load`` on one pad, about the centre of the contact, needs at ``mu``, N.

        Divided by the actual normal force it is the true utilisation λ.
        """
        fx, fy, spin = load
        x, y = self.cells
        return utilisation(x, y, self.shares, mu, np.array([fx, fy]), spin, self._about).value


GRAVITY_MPS2 = 9.81


@dataclass(frozen=True)
class Script:
    """When each phase begins, in s from the start, and how much it loads the object.

    Attributes:
        lift_s: The object is lifted from the table; its weight increases over ``ramp_s``.
        ramp_s: How long the weight takes to move to the gripper, or back to the table.
        pour_s: Something is poured into the far end of the object until ``pour_until_s``; its weight grows, and with it
            the torque about the normal of the pads.
        pour_until_s: End of that growth; the poured weight stays.
        drain_s: The poured weight starts to drain, within ``drain_takes_s``.
        drain_takes_s: How long that takes; a load that vanishes faster looks like a slip.
        pour_n_per_s: Growth of the poured weight.
        lever_m: Horizontal distance of the poured weight from the centre of the contact.
        tug_s: A hand starts to pull the object along +y of the left pad.
        tug_speed_mps: Speed of the hand; a slower one lets the object stick and slip in turns.
        tug_stiffness_n_per_m: Stiffness of the hand: the pull grows by stiffness times speed until the object slips.
        tug_damping_ns_per_m: Damping of the hand, so that the object follows without bouncing.
        tug_slip_s: The hand lets go when the object has slipped for this long.
        set_down_s: The table takes over the load within ``ramp_s``; the hand lets go.
    """

    lift_s: float = 4.0
    ramp_s: float = 0.5
    pour_s: float = 6.0
    pour_until_s: float = 10.0
    drain_s: float = 11.5
    drain_takes_s: float = 1.0
    pour_n_per_s: float = 0.35
    lever_m: float = 0.06
    tug_s: float = 13.0
    tug_speed_mps: float = 0.03
    tug_stiffness_n_per_m: float = 750.0
    tug_damping_ns_per_m: float = 40.0
    tug_slip_s: float = 0.3
    set_down_s: float = 15.0

    def carried(self, t_s: float) -> float:
        """Return the share of the weight that the gripper carries, not the table, 0 to 1."""
        return _ramp(t_s, self.lift_s, self.ramp_s) - _ramp(t_s, self.set_down_s, self.ramp_s)

    def weight(self, t_s: float, mass_kg: float) -> Load:
        """Return the load of the weight of the object and of what was poured into it."""
        poured_s = max(min(t_s, self.pour_until_s) - self.pour_s, 0.0)
        poured_n = self.pour_n_per_s * poured_s * (1.0 - _ramp(t_s, self.drain_s, self.drain_takes_s))
        carried = self.carried(t_s)
        return carried * (mass_kg * GRAVITY_MPS2 + poured_n), 0.0, carried * poured_n * self.lever_m

    def tug_n(self, pulled_s: float, moved_m: float, speed_mps: float) -> float:
        """Return the pull of the hand, N, ``pulled_s`` after it gripped an object that has moved by ``moved_m``."""
        stretch_m = self.tug_speed_mps * pulled_s - moved_m
        return max(self.tug_stiffness_n_per_m * stretch_m - self.tug_damping_ns_per_m * speed_mps, 0.0)

    def phase(self, t_s: float) -> str:
        """Return the name of the phase at a time."""
        phases = (
            (-math.inf, "approach"),
            (self.lift_s, "lift"),
            (self.pour_s, "pour"),
            (self.pour_until_s, "hold"),
            (self.drain_s, "drain"),
            (self.tug_s, "tug"),
            (self.set_down_s, "set_down"),
            (self.set_down_s + self.ramp_s, "on_table"),
        )
        return [name for begins_s, name in phases if t_s >= begins_s][-1]


def _ramp(t_s: float, begins_s: float, takes_s: float) -> float:
    return min(max((t_s - begins_s) / takes_s, 0.0), 1.0)
