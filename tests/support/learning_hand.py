"""Rows of readings that teach friction, as the kernels of the contact fill them in."""

from __future__ import annotations

import math
from collections.abc import Iterable

from slipd.friction.friction_estimate import FrictionEstimate
from slipd.friction.friction_state import FrictionState
from slipd.fusion.friction_learning import learn
from slipd.fusion.rows import FREE, READING, TOUCHING, new_rows

STEP_S = 0.005
"""Time from one reading to the next, s."""
Q = tuple[float, float, float, bool]
"""Required friction, peak, plateau, and whether it slips."""


def carry(q: float, seconds: float = 0.3) -> list[Q]:
    """Readings that carry q without motion."""
    return [(q, math.nan, math.nan, False)] * round(seconds / STEP_S)


def slip(peak: float, plateau: float, seconds: float = 0.05) -> list[Q]:
    """Readings of a slip from a peak to a plateau, of which the first also shows the peak."""
    return [(plateau, peak, plateau, True), *[(plateau, math.nan, plateau, True)] * round(seconds / STEP_S)]


class Hand:
    """An estimate, and the readings that it gets."""

    def __init__(self, mu: float | None = 0.5, spread: float = 0.1, most: float = 1.0) -> None:
        self.estimate = FrictionEstimate(mu, spread, most)
        self._t_s = 100.0

    def feel(
        self,
        readings: Iterable[Q],
        *,
        phase: int = TOUCHING,
        ratio: float = 1.0,
        noise: float = 0.0,
        shape: float = 0.0,
        teaches: bool = True,
        pauses: bool = True,
    ) -> FrictionState:
        """Learn from readings of a pure translation; ``ratio``: the part of q that the friction ratio is."""
        values = list(readings)
        rows = new_rows(READING, len(values))
        times_ns = [round((self._t_s + (k + 1) * STEP_S) * 1e9) for k in range(len(values))]
        self._t_s += len(values) * STEP_S
        rows["t_s"] = [t_ns * 1e-9 for t_ns in times_ns]
        names = ("required_friction", "peak_required", "plateau_required", "slips")
        for name, column in zip(names, zip(*values, strict=True), strict=True):
            rows["assessment"][name] = column
        rows["phase"], rows["contact"]["friction_ratio_std"] = phase, noise
        rows["contact"]["friction_ratio"] = ratio * rows["assessment"]["required_friction"]
        begin = 0
        while begin < len(values):
            end = self.estimate.begin_step(times_ns, begin)
            learn(rows[begin:end], self.estimate.learning, shape, 0 if teaches else end)
            begin = end
        if pauses:
            self.pause()
        return self.estimate.state

    def pause(self) -> None:
        """Let a step of time pass, so that what was learned is in force."""
        self.estimate.begin_step([round((self._t_s + 0.02) * 1e9)], 0)

    def let_go(self) -> FrictionState:
        """End the contact."""
        return self.feel(carry(math.nan, STEP_S), phase=FREE)
