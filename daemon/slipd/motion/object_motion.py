"""Evidence of motion of the whole object: "width" by the jaws, "external" by another process.

Width: the jaws move although no command moves them, so the object rolls, turns or slides out of them. The width at the
beginning of a hold is the reference. It is followed slowly, because pads of rubber creep for minutes. A new command, or
a gripper that reports a motion of its own after one, begins another hold.

External: a process such as that of a camera reports where the object is, or how fast it moves. The first poses of a
hold are the reference, and their scatter is the noise. A camera errs with the pose of the arm too, which no scatter
shows, so the config states the least error of a position. A speed comes with its own error.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from statistics import fmean, variance

import numpy as np
from scipy.spatial.transform import Rotation

from slipd.motion.evidence import Evidence, f_surprise
from slipd.types.arrays import Array
from slipd.types.samples import ObjectSample

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
WINDOWS, LONG_STEP = 256, 8
"""Windows whose means show the noise, and windows of the longer step between them."""
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
        if t_ns - (self._since_ns or t_ns) < SETTLED_NS:
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
        return Evidence("width", t_ns, f_surprise(change_m**2 / max(variance_m2, 1e-12), 1, REFERENCE - 1))

    def _walk(self) -> float:
        """Return the variance of one step of a random walk, m², of which the noise of the window means consists.

        Steps over h windows have the variance 2 w + h d for white noise of variance w and a walk of variance d. Their
        medians are those of the noise also where a few of them are those of a motion. Until the longer steps are many
        enough, all noise counts as a walk.
        """
        short, count = _mean_square(self._means, 1), len(self._means) - LONG_STEP
        if count < LONG_STEP:
            return short
        doubt = 1.0 + 1.5 * math.sqrt(LONG_STEP / count)
        return min(max(doubt * _mean_square(self._means, LONG_STEP) - short, 0.0) / (LONG_STEP - 1), short)


def _mean_square(means: Sequence[float], step: int) -> float:
    """Return the mean square of steps of normal noise over so many windows, by its median; 0 where there are none."""
    if len(means) <= step:
        return 0.0
    squares = (np.array(means)[step:] - np.array(means)[:-step]) ** 2
    return float(np.median(squares)) / MEDIAN_SQUARE


POSES_SETTLED_NS = 200_000_000
"""A hold this young still settles."""
REFERENCE_POSES = 12
"""Poses of the reference, with which the noise is measured."""
REACH_M = 0.05
"""An error of the position is one of the direction at this distance, m: half the size of an object."""
KNOWN = 1e6
"""Degrees of freedom of an error that is stated."""


class OutsideMotion:
    """Finds motion of the object in what another process reports of it.

    False alarms: with errors no larger than stated and measured, a surprise above s comes in less than exp(−s) of the
    looks. Each reading is a look.

    Args:
        std_m: Least standard deviation of a position, m.
        rate_hz: Rate of the readings, 1/s.
    """

    def __init__(self, std_m: float, rate_hz: float) -> None:
        self._std_m = std_m
        self.looks_per_hour = 3600.0 * rate_hz
        self._begin(None)

    def _begin(self, t_ns: int | None) -> None:
        """Begin a hold; None: nothing is held."""
        self._since_ns = t_ns
        self._first: list[Array] = []
        self._turn: Rotation | None = None
        self._mean: Array = np.empty(0)
        self._variance, self._freedom = np.empty(0), KNOWN
        self._before = 0.0

    def update(self, t_ns: int, reading: ObjectSample, *, held: bool) -> Evidence | None:
        """Update with a reading; return evidence where the object moves.

        Args:
            t_ns: Time of the reading, CLOCK_MONOTONIC.
            reading: The reading.
            held: An object is held.
        """
        if not held:
            self._begin(None)
            return None
        if self._since_ns is None:
            self._begin(t_ns)
        if t_ns - (self._since_ns or t_ns) < POSES_SETTLED_NS:
            return None
        found = [surprise for surprise in (_of_speed(reading), self._of_pose(reading)) if surprise is not None]
        if not found:
            return None
        surprise = max(found) - math.log(len(found))
        lasts, self._before = min(surprise, self._before), surprise  # a single wrong reading does not count
        return Evidence("external", t_ns, lasts) if lasts > 0.0 else None

    def confirm(self) -> None:
        """Take the newest evidence as true: the pose of now is the one from which a further motion is measured."""
        self._begin(self._since_ns)

    def _of_pose(self, reading: ObjectSample) -> float | None:
        """Return the surprise of a displacement since the reference; None while there is none."""
        if reading.xyz_m is None:
            return None
        pose = self._pose(reading.xyz_m, reading.quat_xyzw)
        if self._first and len(pose) != len(self._first[0]):  # the orientation came or went
            self._begin(self._since_ns)
            pose = self._pose(reading.xyz_m, reading.quat_xyzw)
        if len(self._first) < REFERENCE_POSES:
            self._first.append(pose)
            if len(self._first) == REFERENCE_POSES:
                self._measure()
            return None
        away = pose - self._mean
        return f_surprise(float((away * away / self._variance).mean()), len(pose), self._freedom)

    def _measure(self) -> None:
        """Take the first poses as the reference: what is stated and what is measured of their error add up."""
        poses = np.array(self._first)
        measured, stated = poses.var(axis=0, ddof=1), self._std_m**2
        self._mean = poses.mean(axis=0)
        self._variance = measured * (1.0 + 1.0 / REFERENCE_POSES) + stated
        most = max(float(measured.max()), 1e-6 * stated)
        self._freedom = min((REFERENCE_POSES - 1) * ((most + stated) / most) ** 2, KNOWN)  # Welch and Satterthwaite

    def _pose(self, xyz_m: tuple[float, ...], quat_xyzw: tuple[float, ...] | None) -> Array:
        """Return position and, where it is known, orientation times ``REACH_M``, from that of the first."""
        place = np.array(xyz_m)
        if quat_xyzw is None:
            return place
        turn = Rotation.from_quat(quat_xyzw)
        if self._turn is None or not self._first:
            self._turn = turn
        return np.concatenate((place, REACH_M * (self._turn.inv() * turn).as_rotvec()))


def _of_speed(reading: ObjectSample) -> float | None:
    """Return the surprise of a speed that its error explains; None where it is not stated."""
    if reading.speed_mps is None or not reading.speed_std_mps:
        return None
    return f_surprise((max(reading.speed_mps, 0.0) / reading.speed_std_mps) ** 2, 1, KNOWN)
