"""Pad geometry: taxel positions, neighbours, and the wrench of three-axis taxels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slipd.fusion.compiled import compiled
from slipd.types.arrays import Array, Indices

STEPS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
"""Steps (rows, columns) to the eight neighbours of a taxel, in the order of `neighbours`."""


@dataclass(frozen=True, slots=True)
class PadGeometry:
    """A rectangular pad, read row by row.

    Attributes:
        rows: Number of rows of the scan; the row index runs along Y of the pad frame (along X with ``swap_xy``).
        cols: Number of columns of the scan; the column index runs along X (along Y with ``swap_xy``).
        pitch_m: Distance between neighbouring taxels, m.
        electrode_m: Diameter of the sensing electrode, m.
        swap_xy: The row index runs along X.
        flip_x: The scan runs in the direction of −X.
        flip_y: The scan runs in the direction of −Y.
    """

    rows: int
    cols: int
    pitch_m: float
    electrode_m: float
    swap_xy: bool = False
    flip_x: bool = False
    flip_y: bool = False

    @property
    def taxels(self) -> int:
        """Number of taxels."""
        return self.rows * self.cols

    @property
    def rows_along(self) -> str:
        """Direction of the pad frame in which the row index grows: "+x", "-x", "+y" or "-y"."""
        return self._direction(along_x=self.swap_xy)

    @property
    def cols_along(self) -> str:
        """Direction in which the column index grows, as `rows_along`."""
        return self._direction(along_x=not self.swap_xy)

    def _direction(self, *, along_x: bool) -> str:
        against = self.flip_x if along_x else self.flip_y
        return ("-" if against else "+") + ("x" if along_x else "y")

    def positions(self) -> tuple[Array, Array]:
        """Taxel centres x, y in the pad frame, each shape (rows · cols,) in scan order, m."""
        row, col = np.divmod(np.arange(self.taxels), self.cols)
        across = (col - 0.5 * (self.cols - 1)) * self.pitch_m
        along = (row - 0.5 * (self.rows - 1)) * self.pitch_m
        x, y = (along, across) if self.swap_xy else (across, along)
        return (-x if self.flip_x else x), (-y if self.flip_y else y)

    def sides(self) -> Indices:
        """Return the neighbours of each taxel towards −X, +X, −Y and +Y, shape (4, n); itself at the border."""
        here, around = np.arange(self.taxels), neighbours(self.rows, self.cols)
        up, left, right, down = (np.where(side < 0, here, side) for side in around[:, (1, 3, 4, 6)].T)
        x, y = ((up, down), (left, right)) if self.swap_xy else ((left, right), (up, down))
        return np.array((*(x[::-1] if self.flip_x else x), *(y[::-1] if self.flip_y else y)))


def neighbours(rows: int, cols: int) -> Indices:
    """Return the eight neighbours of every taxel of a pad that is scanned row by row.

    Returns:
        Indices in scan order, shape (rows · cols, 8), in the order of ``STEPS``; −1 beyond the border.
    """
    framed = np.full((rows + 2, cols + 2), -1, dtype=np.int64)
    framed[1:-1, 1:-1] = np.arange(rows * cols).reshape(rows, cols)
    shifted = [framed[1 + down : 1 + down + rows, 1 + right : 1 + right + cols].ravel() for down, right in STEPS]
    return np.stack(shifted, axis=1)


@compiled
def loads_above(loads: Array, threshold: float) -> Array:
    """Return the loads above a threshold, with 0 in place of the others, shape (n,)."""
    found = np.zeros(len(loads))
    for k in range(len(loads)):
        if loads[k] > threshold:
            found[k] = loads[k]
    return found


def taxel_wrench(x: Array, y: Array, forces: Array) -> tuple[Array, Array]:
    """Sum three-axis taxel forces to the wrench on the pad.

    Args:
        x: Taxel centres, shape (n,), m.
        y: Taxel centres, shape (n,), m.
        forces: Force on each taxel in the pad frame, shape (n, 3), N.

    Returns:
        Force (3,), N, and torque about the pad's origin (3,), N·m: M = Σ r × f with r in the plane Z = 0.
    """
    fx, fy, fz = forces.T
    torque = np.array((y @ fz, -(x @ fz), x @ fy - y @ fx))
    return forces.sum(axis=0), torque
