"""A grasped object, the friction between it and the pads, and the compliance of the pads."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slipd.tools.sim.stepped_grasp import DAMPING_NS_PER_M3, STIFFNESS_N_PER_M3, Pair
from slipd.tools.sim.stepped_grasp import FrictionLaw as DryFriction
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
class FrictionLaw(DryFriction):
    """Friction of a cell that slides at a speed.

    Attributes:
        wet: Factor on all of μ over the surface of the object; None is 1 everywhere.

    Raises:
        ValueError: A number is out of range.
    """

    wet: FrictionMap | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.mu_d <= self.mu_s < math.inf:
            raise ValueError(f"must be 0 < mu_d <= mu_s, got mu_d {self.mu_d} and mu_s {self.mu_s}")
        if not (self.stribeck_mps > 0.0 and self.viscous_s_per_m >= 0.0 and self.memory_s >= 0.0):
            raise ValueError(
                "stribeck_mps must be > 0, viscous_s_per_m and memory_s ≥ 0, got "
                f"{self.stribeck_mps}, {self.viscous_s_per_m} and {self.memory_s}"
            )


@dataclass(frozen=True)
class GraspedObject:
    """A rigid object with two flat, parallel faces. Positions are in the frame of the left pad before it has moved.

    Attributes:
        mass_kg: Mass.
        inertia_kgm2: Moment of inertia about the normal of the pads through the centre of mass.
        centre_of_mass_m: Centre of mass.
        half_length_m: Half length of the faces along x; beyond them nothing presses on a pad. inf: without end.
        half_width_m: Likewise along y.
        centre_m: Centre of the faces.

    Raises:
        ValueError: A number is not positive.
    """

    mass_kg: float = 0.25
    inertia_kgm2: float = 1e-3
    centre_of_mass_m: Pair = (0.0, 0.0)
    half_length_m: float = math.inf
    half_width_m: float = math.inf
    centre_m: Pair = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not (
            self.mass_kg > 0.0 and self.inertia_kgm2 > 0.0 and self.half_length_m > 0.0 and self.half_width_m > 0.0
        ):
            raise ValueError(f"mass, inertia and half lengths must be positive, got {self}")


@dataclass(frozen=True)
class PadCompliance:
    """Compliance of the surface of a pad under shear.

    Attributes:
        stiffness_n_per_m3: Tangential stiffness per area.
        damping_ns_per_m3: Tangential damping per area.
        half_length_m: Half length of the pad along x; beyond it there is no contact. inf: without end.
        half_width_m: Likewise along y.

    Raises:
        ValueError: A number is out of range.
    """

    stiffness_n_per_m3: float = STIFFNESS_N_PER_M3
    damping_ns_per_m3: float = DAMPING_NS_PER_M3
    half_length_m: float = math.inf
    half_width_m: float = math.inf

    def __post_init__(self) -> None:
        if not (self.stiffness_n_per_m3 > 0.0 and self.damping_ns_per_m3 >= 0.0):
            raise ValueError(f"stiffness must be > 0 and damping ≥ 0, got {self}")
        if not (self.half_length_m > 0.0 and self.half_width_m > 0.0):
            raise ValueError(f"half lengths must be positive, got {self}")
