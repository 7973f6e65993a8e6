"""Identify mass, centre of mass and sensor bias of a finger from its unloaded readings in several poses.

In the pad frame a reading without contact is F = b_F + m g and M = b_M + c × m g. Forces give the mass and the force
bias, torques the moment p = m c and the torque bias, each by linear least squares about the means, with d = g − ḡ:
m = Σ d·F / Σ d·d, and p solves Σ (|d|² I − d dᵀ) p = Σ d × M. If gravity changes along a single line only, the centre
of mass along that line is not observable.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from slipd.types.arrays import Array

MIN_POSES = 3
"""Least number of poses: two lie on a line."""
LEAST_CHANGE_MPS2 = 2.0
"""Least root-mean-square change of gravity across every direction, m/s², about 12°. With less, an orientation error of
one degree changes the result by a tenth."""
LEAST_SIGNIFICANCE = 5.0
"""Standard errors by which a mass must differ from zero."""


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """Part beyond the sensor, and reading of the sensor without load; all in the pad frame.

    Attributes:
        mass_kg: Mass, kg.
        mass_std_kg: Standard error of the mass, kg.
        com_m: Centre of mass, shape (3,), m.
        com_std_m: Standard error of each coordinate, shape (3,), m.
        bias_force_n: Reading without weight, shape (3,), N.
        bias_torque_nm: Likewise, about the pad's origin, shape (3,), N·m.
        residual_n: Root mean square of the residuals of a force component, N.
        residual_nm: Root mean square of the residuals of a torque component, N·m.
        condition: Ratio of the best to the worst observable direction of the centre of mass; 1 is best.
        poses: Number of poses.
    """

    mass_kg: float
    mass_std_kg: float
    com_m: Array
    com_std_m: Array
    bias_force_n: Array
    bias_torque_nm: Array
    residual_n: float
    residual_nm: float
    condition: float
    poses: int

    def lines(self) -> list[str]:
        """Return what was found, for people: mass and centre of mass, then the residuals."""
        pairs = zip(1e3 * self.com_m, 1e3 * self.com_std_m, strict=True)
        places = ", ".join(f"{at:.1f} ± {std:.1f}" for at, std in pairs)
        return [
            f"mass {1e3 * self.mass_kg:.1f} ± {1e3 * self.mass_std_kg:.1f} g, centre of mass ({places}) mm in the pad "
            "frame, as exact as xyz_m",
            f"residual {self.residual_n:.2g} N, {self.residual_nm:.2g} N·m, in {self.poses} poses",
        ]


def identify(forces: ArrayLike, torques: ArrayLike, gravities: ArrayLike) -> Identification:
    """Fit mass, centre of mass and bias.

    Args:
        forces: Mean force on the finger in each pose, mounted and neither tared nor compensated, shape (poses, 3), N.
        torques: Mean torque about the pad's origin likewise, shape (poses, 3), N·m.
        gravities: Apparent gravity in the pad frame in each pose, shape (poses, 3), m/s².

    Raises:
        ValueError: Values are not finite, the poses leave a direction unobservable (the text names
            it), or the mass is negative or lost in the noise.
    """
    f, t, g = (np.asarray(rows, dtype=np.float64) for rows in (forces, torques, gravities))
    n = len(g)
    if not (np.isfinite(f).all() and np.isfinite(t).all() and np.isfinite(g).all()):
        raise ValueError("forces, torques and gravities must be finite")
    if n < MIN_POSES:
        raise ValueError(f"there must be at least {MIN_POSES} poses with gravity in different directions, got {n}")
    mean_g = g.mean(axis=0)
    d = g - mean_g
    scatter = d.T @ d
    seen = np.trace(scatter) * np.eye(3) - scatter
    condition = _condition(seen / n, mean_g)

    mass = float((d * f).sum() / np.trace(scatter))
    bias_f = f.mean(axis=0) - mass * mean_g
    residual_n = _residual(f - mass * g - bias_f, parameters=4)
    mass_std = residual_n / math.sqrt(np.trace(scatter))
    _check_mass(mass, mass_std)

    moment = np.linalg.solve(seen, np.cross(d, t).sum(axis=0))
    bias_t = t.mean(axis=0) - np.cross(moment, mean_g)
    residual_nm = _residual(t - np.cross(moment, g) - bias_t, parameters=6)
    moment_std = residual_nm * np.sqrt(np.diag(np.linalg.inv(seen)))
    com = moment / mass
    com_std = np.hypot(moment_std, com * mass_std) / mass
    return Identification(mass, mass_std, com, com_std, bias_f, bias_t, residual_n, residual_nm, condition, n)


def _condition(seen: Array, mean_g: Array) -> float:
    """Return the ratio of the best to the worst observable direction; raise if one is not observable."""
    squares, directions = np.linalg.eigh(seen)
    changes = np.sqrt(np.maximum(squares, 0.0))
    if changes[0] >= LEAST_CHANGE_MPS2:
        return float(changes[2] / changes[0])
    if changes[2] < LEAST_CHANGE_MPS2:
        raise ValueError(
            f"gravity is about {_vector(mean_g)} m/s² in every pose; add poses in which the finger is tilted by 30° or "
            "more about two different axes"
        )
    along, one, other = map(_vector, directions.T)
    raise ValueError(
        f"gravity changes along {along} of the pad frame only, so the centre of mass along it is not observable; "
        f"add poses in which gravity changes across it, along {one} or {other}"
    )


def _check_mass(mass: float, std: float) -> None:
    value = f"{mass * 1e3:.2f} ± {std * 1e3:.2f} g"
    if abs(mass) < LEAST_SIGNIFICANCE * std or mass == 0.0:
        raise ValueError(
            f"mass must differ clearly from zero, got {value}: leave mass_kg out, or tilt further and read longer"
        )
    if mass < 0.0:
        raise ValueError(
            f"mass must be positive, got {value}: sign or pad_from_sensor is wrong, or gravity points the other way"
        )


def _residual(left: Array, parameters: int) -> float:
    return math.sqrt(float((left * left).sum()) / (left.size - parameters))


def _vector(values: Array) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in values + 0.0) + ")"
