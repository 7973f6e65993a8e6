"""Evidence "width" that the object moves: the jaws move although no command moves them.

So the object rolls, turns or slides out of them. The width at the beginning of a hold is the reference. It is followed
slowly, because pads of rubber creep for minutes. A new command, or a gripper that reports a motion of its own after
one, begins another hold.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from statistics import fmean, variance

import numpy as np

from slipd.motion.evidence import (
    LASTS_NS,
    LEAST_READINGS,
    LEAST_STD_M,
    LONG_STEP,
    REFERENCE,
    Evidence,
    f_surprise,
    walk_variance,
)

LEAST_M = 3e-4
"""A smaller change may be that of the pads, m."""
MEDIAN_SQUARE = 0.455
"""Median of the square of a standard normal variable."""
WINDOWS = 256
"""Windows whose means show the noise."""
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
        self._command: object = None
        self._begin(None)

    def _begin(self, t_ns: int | None) -> None:
        """Begin a hold; None: nothing is held."""
        self._since_ns = t_ns
        self._window: list[float] = []
        self._window_ns = self._looked_ns = 0
        self._reference_m: float | None = None
        self._variance = 0.0
        self._means: deque[float] = deque(maxlen=WINDOWS)
        self._looks = 0

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
        if t_ns - (self._since_ns or t_ns) < LASTS_NS:
            return None
        if not self._window:
            self._window_ns = t_ns
        self._window.append(width_m)
        if self._reference_m is None:
            if len(self._window) == REFERENCE:
                self._reference_m, self._looked_ns = fmean(self._window), t_ns
                self._variance = variance(self._window) + self._step_m**2 / 12.0
                self._window = []
            return None
        if t_ns - self._window_ns < LASTS_NS or len(self._window) < LEAST_READINGS:
            return None
        return self._look(t_ns, self._reference_m)

    def confirm(self) -> None:
        """Take the newest evidence as true: the width of now is the one from which a further motion is measured."""
        self._begin(self._since_ns)

    def _look(self, t_ns: int, reference_m: float) -> Evidence | None:
        """Compare the newest window with the reference, let that follow, and begin the next window."""
        change_m = max(min(self._window) - reference_m, reference_m - max(self._window)) - self._step_m
        mean_m, most_m = fmean(self._window), FOLLOW_MPS * (t_ns - self._looked_ns) * 1e-9
        self._window, self._looked_ns = [], t_ns
        self._means.append(mean_m)
        self._looks += 1
        self._reference_m = reference_m + min(max(mean_m - reference_m, -most_m), most_m)
        if change_m < LEAST_M:
            return None
        drift = self._walk()
        # The reference follows a walk, which strays from it by about half of drift / most_m, however long it lasts.
        variance_m2 = self._variance + min(self._looks * drift, (drift / most_m) ** 2)
        return Evidence("width", t_ns, f_surprise(change_m**2 / max(variance_m2, LEAST_STD_M**2), 1, REFERENCE - 1))

    def _walk(self) -> float:
        """Return the variance of one step of a random walk, m², of which the noise of the window means consists.

        The medians of the steps are those of the noise also where a few of them are those of a motion.
        """
        short, longer = (np.array(_mean_square(self._means, step)) for step in (1, LONG_STEP))
        return float(walk_variance(short, longer, len(self._means) - LONG_STEP))


def _mean_square(means: Sequence[float], step: int) -> float:
    """Return the mean square of steps of normal noise over so many windows, by its median; 0 where there are none."""
    if len(means) <= step:
        return 0.0
    squares = (np.array(means)[step:] - np.array(means)[:-step]) ** 2
    return float(np.median(squares)) / MEDIAN_SQUARE
