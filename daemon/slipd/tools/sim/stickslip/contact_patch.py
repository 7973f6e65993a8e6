"""The shape of a contact and of its pressure."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slipd.tools.sim.stickslip.pressure_kernels import DISC, EDGE, RECTANGLE, RING, ROUNDED, STRIPS
from slipd.types.arrays import Array

KINDS = {
    "disc": DISC,
    "ring": RING,
    "rectangle": RECTANGLE,
    "square": RECTANGLE,
    "two_strips": STRIPS,
    "edge": EDGE,
    "rounded": ROUNDED,
}
"""Shapes by name."""


@dataclass(frozen=True)
class ContactPatch:
    """A contact patch, in the frame of the left pad.

    With u and v the coordinates from its centre over the half lengths, and e the exponent, the relative pressure is

    - disc (an ellipse where the half lengths differ): (1 − u² − v²)^e; e = 1/2 is Hertz's pressure;
    - rectangle, square: ((1 − u⁴)(1 − v⁴))^e;
    - rounded: (1 − u⁴ − v⁴)^e, between the two;
    - ring: between ``inner`` and 1 of the radius, the pressure of a tube, (1 − w²)^e with w from −1 to 1 across it;
    - two_strips: two strips along x, from ``inner`` to 1 of the half width on either side, likewise;
    - edge: a rectangle whose pressure rises linearly from 0 at u = −1 to its most at u = +1.

    With e = 0 the pressure is uniform.

    Attributes:
        kind: One of `KINDS`.
        half_length_m: Half length along x at the reference force.
        half_width_m: Half width along y at the reference force; None takes the half length.
        inner: Inner over outer size of "ring" and "two_strips".
        exponent: e.
        growth: γ: the size is proportional to (f / reference)^γ about the centre; 0 is rigid, 1/3 is Hertz.
        reference_n: Normal force on one pad at which the half lengths hold, N.
        centre_m: Centre; not always the centroid of the pressure.
        moves_with_object: Whether the patch moves over the pad with the object, as that of an edge or of a small
            object does. Otherwise it stays on the pad, as with a crowned pad on a flat box.

    Raises:
        ValueError: A number is out of range, or the kind is unknown.
    """

    kind: str = "rounded"
    half_length_m: float = 0.018
    half_width_m: float | None = 0.009
    inner: float = 0.6
    exponent: float = 0.5
    growth: float = 0.0
    reference_n: float = 10.0
    centre_m: tuple[float, float] = (0.0, 0.0)
    moves_with_object: bool = False

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"kind must be one of {', '.join(KINDS)}, got {self.kind!r}")
        if not (0.0 < self.half_length_m < math.inf and 0.0 < self.width_m < math.inf):
            raise ValueError(f"half lengths must be positive, got {self.half_length_m} and {self.half_width_m}")
        if self.kind == "square" and self.width_m != self.half_length_m:
            raise ValueError(f"a square must have one half length, got {self.half_length_m} and {self.half_width_m}")
        if not (0.0 <= self.inner < 1.0 and self.exponent >= 0.0):
            raise ValueError(f"inner must be in [0, 1) and exponent ≥ 0, got {self.inner} and {self.exponent}")
        if not (0.0 <= self.growth <= 1.0 and self.reference_n > 0.0):
            raise ValueError(f"growth must be in [0, 1] and reference_n > 0, got {self.growth} and {self.reference_n}")

    @property
    def width_m(self) -> float:
        """The half width."""
        return self.half_length_m if self.half_width_m is None else self.half_width_m

    def scale(self, normal_n: float) -> float:
        """Return the size of the patch at a normal force over its size at the reference force."""
        if self.growth == 0.0:
            return 1.0
        return float((max(normal_n, 0.0) / self.reference_n) ** self.growth)

    def cells(self, cell_m: float, largest_n: float) -> Array:
        """Divide the patch, as large as it is at the largest normal force, into square cells.

        Returns:
            Centres of the cells, shape (2, n), m. Their area is ``cell_m``².
        """
        halves = max(self.scale(largest_n), 1e-9) * np.array(((self.half_length_m,), (self.width_m,)))
        cells = np.stack(np.meshgrid(*(_middles(half, cell_m) for half in halves[:, 0]))).reshape(2, -1)
        if self.kind in ("disc", "ring"):  # without the corners
            nearest = np.clip(np.abs(cells) - cell_m, 0.0, None) / halves
            cells = cells[:, np.hypot(*nearest) <= 1.0]
        return np.ascontiguousarray(cells + np.array(self.centre_m)[:, None])


def _middles(half_m: float, cell_m: float) -> Array:
    n = 2 * math.ceil(half_m / cell_m - 1e-9)
    return np.asarray((np.arange(n) - (n - 1) / 2) * cell_m, dtype=np.float64)
