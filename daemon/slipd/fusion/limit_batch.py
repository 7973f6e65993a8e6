"""The friction limit of many frames in one call, for offline work.

A frame with fewer taxels is padded with loads of 0: a taxel that carries nothing is not in contact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slipd.fusion.contact import not_numbers
from slipd.fusion.limit.batch import solve_torque_limits, solve_utilisations
from slipd.fusion.limit.solve import GOAL, KINDS, MAX_PASSES
from slipd.fusion.rows import TORQUE_LIMIT, UTILISATION, new_rows
from slipd.types.arrays import Array

_NAMES = np.array(KINDS)


@dataclass(frozen=True, slots=True, eq=False)
class TorqueLimits:
    """`TorqueLimit` of many frames.

    Attributes:
        torque_nm: Shape (frames,), N·m.
        lower_nm: Certified lower bounds, shape (frames,), N·m.
        upper_nm: Certified upper bounds, shape (frames,), N·m.
        pole_m: Shape (frames, 2), m; NaN where there is none.
        kind: As in `TorqueLimit`, shape (frames,).
    """

    torque_nm: Array
    lower_nm: Array
    upper_nm: Array
    pole_m: Array
    kind: NDArray[np.str_]


@dataclass(frozen=True, slots=True, eq=False)
class Utilisations:
    """`Utilisation` of many frames.

    Attributes:
        value: Shape (frames,).
        lower: Certified lower bounds, shape (frames,).
        upper: Certified upper bounds, shape (frames,).
        pole_m: Shape (frames, 2), m; NaN where there is none.
        kind: As in `Utilisation`, shape (frames,).
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
    """Find the `torque_limit` of every frame.

    Args:
        x: Taxel centres in the pad frame, shape (n,) or (frames, n), m.
        y: Likewise, m.
        loads: Normal forces, shape (frames, n), N; 0 where there is no contact.
        mu: Coefficient of static friction.
        tangential: f_t on the finger, shape (frames, 2), N.
        about: The point that the torque refers to, shape (2,) or (frames, 2), m.
        sense: +1 for a torque along +Z, −1 for one along −Z.
        gap: Gap of the bounds at which to stop, relative to the contact's torque without force.
        passes: Most passes over the taxels of each frame.

    Raises:
        ValueError: A shape is wrong, μ is not positive and finite, or the sense is not ±1. Bad data in a frame gives
            that frame the kind "none".
        TypeError: An argument is not numbers.

    >>> limits = torque_limits([-0.01, 0.01], [0.0, 0.0], [[2.0, 2.0], [1.0, 1.0]], 0.5, [[0.0, 0.0]] * 2, (0.0, 0.0))
    >>> limits.torque_nm.round(9).tolist()
    [0.02, 0.01]
    """
    xs, ys, fs, f, a, _ = _frames(x, y, loads, mu, tangential, about)
    if sense not in (1, -1):
        raise ValueError(f"sense must be +1 or -1, got {sense}")
    found = new_rows(TORQUE_LIMIT, len(fs))
    solve_torque_limits(xs, ys, fs, mu, f, a, sense, gap, passes, found)
    return TorqueLimits(
        found["torque_nm"], found["lower_nm"], found["upper_nm"], found["pole_m"], _NAMES[found["kind"]]
    )


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
    """Find the `utilisation` of every frame, each started from the twist of the one before.

    Args:
        x: As in `torque_limits`, like all but the next.
        y: Likewise.
        loads: Likewise.
        mu: Likewise.
        tangential: Likewise.
        spin: Torque about the pad normal through ``about``, shape (frames,), N·m.
        about: Likewise.
        gap: Relative gap of the bounds at which to stop.
        passes: Likewise.

    Raises:
        ValueError: A shape is wrong, or μ is not positive and finite. Bad data in a frame gives that frame NaN.
        TypeError: An argument is not numbers.

    >>> loads, tangential = [[2.0, 2.0], [4.0, 4.0]], [[1.0, 0.0], [1.0, 0.0]]
    >>> found = utilisations([-0.01, 0.01], [0.0, 0.0], loads, 0.5, tangential, [0.0, 0.0], (0.0, 0.0))
    >>> found.value.round(9).tolist()
    [0.5, 0.25]
    """
    xs, ys, fs, f, a, m = _frames(x, y, loads, mu, tangential, about, spin)
    if m.shape != (len(fs),):
        raise ValueError(f"spin must have shape ({len(fs)},), got {m.shape}")
    found = new_rows(UTILISATION, len(fs))
    solve_utilisations(xs, ys, fs, mu, f, m, a, gap, passes, found)
    return Utilisations(
        found["value"], found["lower"], found["upper"], found["pole_m"], _NAMES[found["kind"]], found["twist"]
    )


def _frames(
    x: ArrayLike,
    y: ArrayLike,
    loads: ArrayLike,
    mu: float,
    tangential: ArrayLike,
    about: ArrayLike,
    spin: ArrayLike = (),
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Return the checked arrays; those that all frames share have a first axis of 1. The spin is not checked."""
    try:
        xs, ys, a = (np.atleast_2d(np.ascontiguousarray(v, dtype=np.float64)) for v in (x, y, about))
        fs, f, m = (np.ascontiguousarray(v, dtype=np.float64) for v in (loads, tangential, spin))
        friction_is_positive = 0.0 < mu < math.inf
    except (TypeError, ValueError):
        raise not_numbers(x=x, y=y, loads=loads, mu=mu, tangential=tangential, spin=spin, about=about) from None
    if fs.ndim != 2:
        raise ValueError(f"loads must have shape (frames, n), got {fs.shape}")
    frames, n = fs.shape
    for name, array, width in (("x", xs, n), ("y", ys, n), ("about", a, 2)):
        if array.shape not in ((1, width), (frames, width)):
            raise ValueError(f"{name} must have shape ({width},) or ({frames}, {width}), got {array.shape}")
    if xs.shape != ys.shape:
        raise ValueError(f"x and y must share one shape, got {xs.shape} and {ys.shape}")
    if f.shape != (frames, 2):
        raise ValueError(f"tangential must have shape ({frames}, 2), got {f.shape}")
    if not friction_is_positive:
        raise ValueError(f"mu must be positive and finite, got {mu}")
    return xs, ys, fs, f, a, m
