"""Evidence "width": the jaws move although no command moves them, so the object rolls, turns or slides out of them.

The width at the beginning of a hold is the reference. It is followed slowly, because pads of rubber creep for minutes.
A new command, or a gripper that reports a motion of its own after one, begins another hold.
"""

from __future__ import annotations

import math
from bisect import insort
from collections import deque

from slipd.motion.evidence import Evidence
from slipd.motion.surprises import f_surprise

SETTLED_NS = 300_000_000
"""A hold this young still settles."""
REFERENCE = 16
"""Readings of the reference, with which its noise is measured."""
LASTS_NS, LEAST_READINGS = 200_000_000, 3
"""All readings of this time, at least so many, must differ: a shaken gripper swings back."""
LEAST_M = 3e-4
"""A smaller change may be that of the pads, m."""
MEDIAN_SQUARE = 0.455
"""Median of the square of a standard normal variable."""
FOLLOW_MPS = 2e-5
"""Speed with which the reference follows, m/s: 1 mm in 50 s."""


class WidthChange:
    """Finds motion of the jaws while a gripper holds an object.

    False alarms: under noise alone, white or a random walk, a surprise above s comes in less than exp(−s) of the looks.
    A look is a full window of ``LASTS_NS``, or of ``LEAST_READINGS`` where they are slower.

    Args:
        step_m: Resolution of the width, m; 0: as fine as its numbers.
    """

    looks_per_hour = 3600e9 / LASTS_NS

    def __init__(self, step_m: float) -> None:
        self._step_m = step_m
        self._recent: deque[tuple[int, float]] = deque()
        self._command: object = None
        self._begin(None)

    def _begin(self, t_ns: int | None) -> None:
        """Begin a hold; None: nothing is held."""
        self._since_ns = t_ns
        self._recent.clear()
        self._first: list[float] = []
        self._reference_m = self._std_m = math.nan
        self._followed_ns = 0
        self._mean_m = math.nan
        self._steps: list[float] = []

    def update(self, t_ns: int, width_m: float | None, *, held: bool, command: object) -> Evidence | None:
        """Update with a reading of the gripper; return evidence where the jaws moved.

        Args:
            t_ns: When it was received.
            width_m: Width between the pads, m; None: not known.
            held: An object is held, and no commanded motion is under way.
            command: What was commanded last; another one begins another hold.
        """
        if not held or width_m is None or not math.isfinite(width_m):
            self._begin(None)
            return None
        if self._since_ns is None or command != self._command:
            self._command = command
            self._begin(t_ns)
        if t_ns - (self._since_ns or t_ns) < SETTLED_NS:
            return None
        if len(self._first) < REFERENCE:
            self._add_to_reference(t_ns, width_m)
            return None
        self._recent.append((t_ns, width_m))
        if t_ns - self._recent[0][0] < LASTS_NS or len(self._recent) < LEAST_READINGS:
            return None
        return self._look(t_ns)

    def confirm(self) -> None:
        """Take the newest evidence as true: the width of now is the one from which a further motion is measured."""
        self._begin(self._since_ns)

    def _add_to_reference(self, t_ns: int, width_m: float) -> None:
        self._first.append(width_m)
        if len(self._first) < REFERENCE:
            return
        mean = sum(self._first) / REFERENCE
        variance = sum((width - mean) ** 2 for width in self._first) / (REFERENCE - 1)
        self._reference_m, self._followed_ns = mean, t_ns
        self._std_m = math.sqrt(variance + self._step_m**2 / 12.0)

    def _look(self, t_ns: int) -> Evidence | None:
        """Compare the newest window with the reference, and begin the next."""
        above = min(width for _, width in self._recent) - self._reference_m
        below = self._reference_m - max(width for _, width in self._recent)
        mean = sum(width for _, width in self._recent) / len(self._recent)
        self._recent.clear()
        if not math.isnan(self._mean_m):
            insort(self._steps, (mean - self._mean_m) ** 2)
        self._mean_m = mean
        most = FOLLOW_MPS * (t_ns - self._followed_ns) * 1e-9
        self._reference_m += min(max(mean - self._reference_m, -most), most)
        self._followed_ns = t_ns
        change = max(above, below) - self._step_m
        if change < LEAST_M:
            return None
        return Evidence("width", t_ns, f_surprise(change**2 / self._variance(), 1, REFERENCE - 1))

    def _variance(self) -> float:
        """Return the variance of the width by noise, m²: that of the reference, and that of a walk since then.

        The median of its steps is that of a walk also where a few of them are those of a motion.
        """
        steps = self._steps
        walk = len(steps) * steps[len(steps) // 2] / MEDIAN_SQUARE if steps else 0.0
        return max(self._std_m**2 + walk, 1e-12)
