"""Friction between the object and the pads."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slipd.types.arrays import Array


@dataclass(frozen=True, eq=False)
class FrictionMap:
    """A factor on the friction over the surface of the object, such as that of a wet patch.

    Attributes:
        x0_m: x of the first column, in the frame of the left pad before the object has moved.
        y0_m: y of the first row.
        cell_m: Distance between neighbouring points.
        factor: Factor at the points, shape (rows along y, columns along x), at least 2 by 2; linear between them, and
            constant beyond.
    """

    x0_m: float
    y0_m: float
    cell_m: float
    factor: Array

    def __post_init__(self) -> None:
        if self.factor.ndim != 2 or min(self.factor.shape) < 2 or not self.cell_m > 0.0:
            raise ValueError(f"a map must be at least 2 by 2 with cell_m > 0, got {self.factor.shape}, {self.cell_m}")
        if not (np.isfinite(self.factor).all() and (self.factor >= 0.0).all()):
            raise ValueError("factor must be finite and not negative")

    @classmethod
    def spot(cls, centre_m: tuple[float, float], radius_m: float, factor: float, cell_m: float = 0.0005) -> FrictionMap:
        """Return a map with a round spot of another friction, such as a drop of water."""
        n = math.ceil(radius_m / cell_m) + 2
        offset = np.arange(-n, n + 1) * cell_m
        away = np.hypot(*np.meshgrid(offset, offset))
        share = np.clip((radius_m - away) / cell_m + 0.5, 0.0, 1.0)
        x, y = centre_m
        return cls(x - n * cell_m, y - n * cell_m, cell_m, 1.0 + (factor - 1.0) * share)


@dataclass(frozen=True)
class FrictionLaw:
    """Friction of a cell that slides at a speed v: μ(v) = μ_d + (μ_s − μ_d) / (1 + (v / v_s)²) + ν v.

    The first two terms follow v with a lag, the frictional memory; the viscous term does not.

    Attributes:
        mu_s: Static coefficient.
        mu_d: Dynamic coefficient, at most ``mu_s``.
        stribeck_mps: v_s, at which half of the drop is done.
        viscous_s_per_m: ν, strengthening with speed; about 0.02 / 1 mm/s makes a contact creep before it slides.
        memory_s: Time constant of the frictional memory.
        wet: Factor on all of μ over the surface of the object; None is 1 everywhere.

    Raises:
        ValueError: A number is out of range.

    Source: Stribeck curve with a Lorentzian, and frictional memory: Hess and Soom, J. Tribology 112 (1990) 147.
    """

    mu_s: float = 0.6
    mu_d: float = 0.45
    stribeck_mps: float = 0.01
    viscous_s_per_m: float = 0.0
    memory_s: float = 0.001
    wet: FrictionMap | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.mu_d <= self.mu_s < math.inf:
            raise ValueError(f"must be 0 < mu_d <= mu_s, got mu_d {self.mu_d} and mu_s {self.mu_s}")
        if not (self.stribeck_mps > 0.0 and self.viscous_s_per_m >= 0.0 and self.memory_s >= 0.0):
            raise ValueError(
                "stribeck_mps must be > 0, viscous_s_per_m and memory_s ≥ 0, got "
                f"{self.stribeck_mps}, {self.viscous_s_per_m} and {self.memory_s}"
            )
