"""The friction limit of many frames at once, for offline work: the same kernels, one call.

A frame of fewer taxels is filled up with loads of 0: a taxel that carries nothing is not in contact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slipd.fusion.limit_kernels import GOAL, KINDS, MAX_PASSES, solve_torque_limits, solve_utilisations

Array = NDArray[np.float64]
_NAMES = np.array(KINDS)


@dataclass(frozen=True, slots=True, eq=False)
class TorqueLimits:
    """:class:`~slipd.fusion.TorqueLimit` of many frames.

    Attributes:
        torque_nm: Shape (frames,), N·m.
        lower_nm: Certified lower bounds, shape (frames,), N·m.
        upper_nm: Certified upper bounds, shape (frames,), N·m.
        pole_m: Shape (frames, 2), m; NaN where there is none.
        kind: Shape (frames,), words.
    """

    torque_nm: Array
    lower_nm: Array
    upper_nm: Array
    pole_m: Array
    kind: NDArray[np.str_]


@dataclass(frozen=True, slots=True, eq=False)
class Utilisations:
    """:class:`~slipd.fusion.Utilisation` of many frames.

    Attributes:
        value: Shape (frames,).
        lower: Certified lower bounds, shape (frames,).
        upper: Certified upper bounds, shape (frames,).
        pole_m: Shape (frames, 2), m; NaN where there is none.
        kind: Shape (frames,), words.
        twist: Shape (frames, 3); NaN where there is none.
    """

    value: Array
    lower: Array
    upper: Array
    pole_m: Array
    kind: NDArray[np.str_]
    twist: Array


def torque_limits(
    x: ArrayLike,
    y: ArrayLike,
    loads: ArrayLike,
    mu: float,
    tangential: ArrayLike,
    about: ArrayLike,
    sense: int = 1,
    *,
    gap: float = GOAL,
    passes: int = MAX_PASSES,
) -> TorqueLimits:
    """Finds :func:`~slipd.fusion.torque_limit` of every frame.

    Args:
        x: Taxel centres in the pad frame, shape (n,) or (frames, n), m.
        y: Likewise, m.
        loads: Normal forces, shape (frames, n), N; 0 where there is no contact.
        mu: Coefficient of static friction.
        tangential: f_t on the finger, shape (frames, 2), N.
        about: The point the torque is taken about, shape (2,) or (frames, 2), m.
        sense: +1 for a torque along +Z, −1 for one along −Z.
        gap: Gap of the bounds at which to stop, relative to the contact's torque without force.
        passes: Most passes over the taxels of each frame.

    Raises:
        ValueError: Wrong shapes, μ not positive and finite, a sense other than ±1. Bad data of a frame is the kind
            "none" of that frame.
    """
    xs, ys, fs, f, a = _frames(x, y, loads, mu, tangential, about)
    if sense not in (1, -1):
        raise ValueError(f"sense must be +1 or -1, not {sense}")
    kinds, out = np.empty(len(fs), np.int64), np.empty((len(fs), 5))
    solve_torque_limits(xs, ys, fs, mu, f, a, sense, gap, passes, kinds, out)
    return TorqueLimits(out[:, 0], out[:, 1], out[:, 2], out[:, 3:5], _NAMES[kinds])


def utilisations(
    x: ArrayLike,
    y: ArrayLike,
    loads: ArrayLike,
    mu: float,
    tangential: ArrayLike,
    spin: ArrayLike,
    about: ArrayLike,
    *,
    gap: float = GOAL,
    passes: int = MAX_PASSES,
) -> Utilisations:
    """Finds :func:`~slipd.fusion.utilisation` of every frame, each started from the twist of the one before.

    Args:
        x: Taxel centres in the pad frame, shape (n,) or (frames, n), m.
        y: Likewise, m.
        loads: Normal forces, shape (frames, n), N; 0 where there is no contact.
        mu: Coefficient of static friction.
        tangential: f_t on the finger, shape (frames, 2), N.
        spin: Torque about the pad normal through ``about``, shape (frames,), N·m.
        about: The point the spin is taken about, shape (2,) or (frames, 2), m.
        gap: Relative gap of the bounds at which to stop.
        passes: Most passes over the taxels of each frame.

    Raises:
        ValueError: Wrong shapes, or μ not positive and finite. Bad data of a frame is NaN for that frame.
    """
    xs, ys, fs, f, a = _frames(x, y, loads, mu, tangential, about)
    m = np.ascontiguousarray(spin, dtype=np.float64)
    if m.shape != (len(fs),):
        raise ValueError(f"spin must have shape ({len(fs)},), not {m.shape}")
    kinds, out = np.empty(len(fs), np.int64), np.empty((len(fs), 8))
    solve_utilisations(xs, ys, fs, mu, f, m, a, gap, passes, kinds, out)
    return Utilisations(out[:, 0], out[:, 1], out[:, 2], out[:, 3:5], _NAMES[kinds], out[:, 5:8])


def _frames(
    x: ArrayLike, y: ArrayLike, loads: ArrayLike, mu: float, tangential: ArrayLike, about: ArrayLike
) -> tuple[Array, Array, Array, Array, Array]:
    """Checked arrays, those that all frames share with a first axis of 1."""
    xs, ys, a = (np.atleast_2d(np.ascontiguousarray(v, dtype=np.float64)) for v in (x, y, about))
    fs, f = (np.ascontiguousarray(v, dtype=np.float64) for v in (loads, tangential))
    if fs.ndim != 2:
        raise ValueError(f"loads must have shape (frames, n), not {fs.shape}")
    frames, n = fs.shape
    for name, array, width in (("x", xs, n), ("y", ys, n), ("about", a, 2)):
        if array.shape not in ((1, width), (frames, width)):
            raise ValueError(f"{name} must have shape ({width},) or ({frames}, {width}), not {array.shape}")
    if xs.shape != ys.shape:
        raise ValueError(f"x and y must share one shape, not {xs.shape} and {ys.shape}")
    if f.shape != (frames, 2):
        raise ValueError(f"tangential must have shape ({frames}, 2), not {f.shape}")
    if not 0.0 < mu < math.inf:
        raise ValueError(f"mu must be positive and finite, not {mu}")
    return xs, ys, fs, f, a
