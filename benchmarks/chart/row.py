"""A row of the failure atlas: a contact, why it is hard, and its true limit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from chart.scenes import MU, PITCH_M, Array, Scene
from numpy.typing import ArrayLike

MM = 1e-3
CENTROID = (math.nan, math.nan)


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """A contact that makes methods fail.

    Attributes:
        name: A few words.
        why: One sentence: what is hard in it.
        scene: The contact and its force; the torque is asked in sense +1.
        limit_nm: What is right, N·m; NaN where there is no such number.
        kind: What kind ours must say; "" where more than one is right.
    """

    name: str
    why: str
    scene: Scene
    limit_nm: float
    kind: str = ""

    @property
    def scale_nm(self) -> float:
        """The unit of errors, N·m: the contact's own torque; for all load in one place, that of one pitch."""
        own = self.scene.torque_scale_nm if math.isfinite(self.limit_nm) else math.nan
        return own if own > 0.0 else self.scene.mu * math.fsum(self.scene.loads) * PITCH_M


def contact(x: ArrayLike, y: ArrayLike, loads: ArrayLike, force: ArrayLike, about: ArrayLike = CENTROID) -> Scene:
    """A scene from numbers, lengths in m; about the load centroid where nothing else is said."""
    xs, ys, fs = (np.asarray(values, dtype=np.float64) for values in (x, y, loads))
    point = np.asarray(about, dtype=np.float64)
    if np.isnan(point).any():
        point = load_centroid(xs, ys, fs)
    return Scene("failure", xs, ys, fs, MU, np.asarray(force, dtype=np.float64), point)


def load_centroid(x: Array, y: Array, loads: Array) -> Array:
    """Σ F r / Σ F, correctly rounded.

    A row's limit is stored, so its inputs must be the same doubles on every processor. A sum in floating point is not:
    its order depends on the width of the vector instructions.
    """
    weights = [Fraction(load) for load in loads.tolist()]
    total = sum(weights)
    return np.array(
        [float(sum(w * Fraction(p) for w, p in zip(weights, at.tolist(), strict=True)) / total) for at in (x, y)]
    )


def phi(scene: Scene, pole: Sequence[float]) -> float:
    """Φ at a pole: the limit where the pole is the right one."""
    lever = (pole[0] - scene.about[0]) * scene.tangential[1] - (pole[1] - scene.about[1]) * scene.tangential[0]
    arms = scene.loads * np.hypot(scene.x - pole[0], scene.y - pole[1])
    return math.fsum((*(scene.mu * arms).tolist(), float(lever)))


def at_taxel(name: str, why: str, scene: Scene, taxel: int) -> Row:
    """A row whose pole is a taxel."""
    return Row(name, why, scene, phi(scene, (float(scene.x[taxel]), float(scene.y[taxel]))), "hinge")
