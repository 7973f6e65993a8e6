"""What really happened in a simulated grasp: the episodes of gross slip, and how near to slip it was.

**Gross slip**: the object slides as a whole (cells with 95 % of the frictional power slide, see
`stepped_grasp.GROSS_SHARE`) and the speed of the contact exceeds `SPEED_MPS`, for `LEAST_S` or
longer; pauses shorter than `PAUSE_S` do not end it. The speed of the contact is √(v² + (ω ρ)²): v at the centre of the
patch, ρ its radius of gyration. Partial slip, where some cells slide and others stick, is not gross slip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slipd.types.arrays import Array

SPEED_MPS = 2e-4
"""Below this the elastic pads follow their load; the slowest creep of the families is faster."""
LEAST_S = 0.01
PAUSE_S = 0.01


class Episode(NamedTuple):
    """One gross slip.

    Attributes:
        begin_s: Its onset.
        end_s: Its end, or that of the run.
    """

    begin_s: float
    end_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The true course of one contact, on the simulator's own times.

    Attributes:
        t_s: Times, shape (n,), rising, s.
        utilisation: λ at the true μ_s, shape (n,).
        speed_mps: Speed of the contact, shape (n,), m/s.
        gross: Whether the object slides as a whole, shape (n,).
        normal_n: Grip force on the pad, shape (n,), N.
        needed_n: Least grip force that holds the load times the safety factor at the true μ_s, shape (n,), N; NaN where
            it was not computed.
        mu: True μ_s.
    """

    t_s: Array
    utilisation: Array
    speed_mps: Array
    gross: NDArray[np.bool_]
    normal_n: Array
    needed_n: Array
    mu: float

    @property
    def step_s(self) -> Array:
        """Duration that each time stands for, shape (n,), s."""
        return np.diff(self.t_s, append=self.t_s[-1])

    def path_m(self, from_s: float, to_s: float) -> float:
        """Return how far the contact slides between two times, m."""
        inside = (self.t_s >= from_s) & (self.t_s < to_s)
        return float((self.speed_mps * self.step_s)[inside].sum())

    def at(self, values: Array, times_s: Array) -> Array:
        """Interpolate one of the arrays at some times."""
        return np.interp(times_s, self.t_s, values)

    def episodes(self) -> list[Episode]:
        """Return every gross slip, in order."""
        moving = (self.gross & (self.speed_mps > SPEED_MPS)).astype(np.int8)
        edges = np.diff(moving, prepend=0, append=0)
        ends = np.append(self.t_s, self.t_s[-1])
        merged: list[Episode] = []
        for first, last in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
            begin_s, end_s = float(self.t_s[first]), float(ends[last])
            if merged and begin_s - merged[-1].end_s < PAUSE_S:
                begin_s = merged.pop().begin_s
            merged.append(Episode(begin_s, end_s))
        return [episode for episode in merged if episode.end_s - episode.begin_s >= LEAST_S - 1e-9]
