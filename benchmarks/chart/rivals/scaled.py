"""Equation (5) and Φ without units, as a careful user would hand them to a solver.

Lengths in units of the contact's spread about its load centroid, forces in units of μ f_n: tolerances and step sizes
then mean the same for a pad in millimetres and one in kilometres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from chart.scenes import Scene

from slipd.types.arrays import Array

NEAREST = 1e-12
"""Distances below this count as this: what keeps the formulas finite on a taxel."""


@dataclass(frozen=True, slots=True)
class Scaled:
    """A scene without units, its origin in the load centroid.

    Attributes:
        x: Taxel centres, shape (n,).
        y: Likewise.
        share: Shares of the normal force, shape (n,), their sum 1.
        tangential: f_t over μ f_n; its length is ρ.
        about: The point torques are taken about.
        torque_nm: What a torque of 1 is, N·m.
    """

    x: Array
    y: Array
    share: Array
    tangential: tuple[float, float]
    about: tuple[float, float]
    torque_nm: float

    @classmethod
    def of(cls, scene: Scene) -> Scaled:
        """The scene without units; contacts of one point keep their unit of length."""
        force = float(scene.loads.sum())
        share = scene.loads / force
        cx, cy = float(share @ scene.x), float(share @ scene.y)
        dx, dy = scene.x - cx, scene.y - cy
        unit = math.sqrt(float(share @ (dx * dx + dy * dy))) or 1.0
        slide = scene.mu * force
        return cls(
            x=dx / unit,
            y=dy / unit,
            share=share,
            tangential=(float(scene.tangential[0]) / slide, float(scene.tangential[1]) / slide),
            about=((float(scene.about[0]) - cx) / unit, (float(scene.about[1]) - cy) / unit),
            torque_nm=slide * unit,
        )

    def ratio(self) -> float:
        """ρ = R / μ; from 1 on the contact slides, and there is no pole to seek."""
        return math.hypot(*self.tangential)

    def about_pole(self, px: float, py: float) -> float:
        """Σ F_i |r_i − P|: friction's torque about the pole, the right side of (6) as printed."""
        dx, dy = self.x - px, self.y - py
        return float(self.share @ np.sqrt(dx * dx + dy * dy))

    def potential(self, pole: Array) -> float:
        """Φ(P): the same torque moved to C."""
        px, py = pole
        arm = (px - self.about[0]) * self.tangential[1] - (py - self.about[1]) * self.tangential[0]
        return self.about_pole(px, py) + arm

    def gradient(self, pole: Array) -> Array:
        """∇Φ: the residue of (5) turned by a right angle."""
        dx, dy = pole[0] - self.x, pole[1] - self.y
        pull = self.share / np.maximum(np.sqrt(dx * dx + dy * dy), NEAREST)
        return np.array((pull @ dx + self.tangential[1], pull @ dy - self.tangential[0]))

    def hessian(self, pole: Array) -> Array:
        """∇²Φ = Σ F_i (I − u uᵀ) / |r_i − P|."""
        dx, dy = self.x - pole[0], self.y - pole[1]
        square = np.maximum(dx * dx + dy * dy, NEAREST * NEAREST)
        curve = self.share / (square * np.sqrt(square))
        mixed = -(curve @ (dx * dy))
        return np.array(((curve @ (dy * dy), mixed), (mixed, curve @ (dx * dx))))

    def residue(self, pole: Array) -> Array:
        """What (5) leaves: the friction of a turn about the pole, less f_t."""
        gx, gy = self.gradient(pole)
        return np.array((gy, -gx))

    def residue_slope(self, pole: Array) -> Array:
        """Jacobian of the residue: ∇²Φ turned likewise."""
        (xx, xy), (_, yy) = self.hessian(pole)
        return np.array(((xy, yy), (-xx, -xy)))
