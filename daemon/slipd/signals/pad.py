"""Where the taxels of a pad are, which ones are side by side, and which way its readings point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Steps in rows and columns to the eight neighbours of a taxel, in the order in which `neighbours` gives them.
STEPS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))


@dataclass(frozen=True, slots=True)
class PadGeometry:
    """A rectangular pad, read row by row.

    Attributes:
        rows: Rows of the scan; they run along Y of the pad frame (along X with ``swap_xy``).
        cols: Columns of the scan; they run along X of the pad frame.
        pitch_m: Distance between neighbouring taxels, m.
        electrode_m: Diameter of the sensing electrode, m.
        swap_xy: The scan's rows run along X.
        flip_x: The scan runs against X.
        flip_y: The scan runs against Y.
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

    def positions(self) -> tuple[Array, Array]:
        """Taxel centres x, y in the pad frame, each shape (rows · cols,) in scan order, m."""
        row, col = np.divmod(np.arange(self.taxels), self.cols)
        across = (col - 0.5 * (self.cols - 1)) * self.pitch_m
        along = (row - 0.5 * (self.rows - 1)) * self.pitch_m
        x, y = (along, across) if self.swap_xy else (across, along)
        return (-x if self.flip_x else x), (-y if self.flip_y else y)


def neighbours(rows: int, cols: int) -> NDArray[np.intp]:
    """Finds the eight neighbours of every taxel of a pad that is read row by row.

    Returns:
        Their indices in scan order, shape (rows · cols, 8), in the order of ``STEPS``; −1 where the pad has ended.
    """
    framed = np.full((rows + 2, cols + 2), -1, dtype=np.intp)
    framed[1:-1, 1:-1] = np.arange(rows * cols).reshape(rows, cols)
    shifted = [framed[1 + down : 1 + down + rows, 1 + right : 1 + right + cols].ravel() for down, right in STEPS]
    return np.stack(shifted, axis=1)


def taxel_wrench(x: Array, y: Array, forces: Array) -> tuple[Array, Array]:
    """Sums three-axis taxel forces into the wrench on the pad.

    Args:
        x: Taxel centres, shape (n,), m.
        y: Likewise, shape (n,), m.
        forces: Force on each taxel in the pad frame, shape (n, 3), N.

    Returns:
        Force (3,), N, and torque about the pad's origin (3,), N·m: M = Σ r × f with r in the plane Z = 0.
    """
    fx, fy, fz = forces.T
    torque = np.array((y @ fz, -(x @ fz), x @ fy - y @ fx))
    return forces.sum(axis=0), torque
