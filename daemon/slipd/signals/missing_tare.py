"""Detect a pad that was never tared and reads tens of newtons with nothing on it.

Raw counts may have any offset. Without a tare the offset would look like a load, so the readings are not used until the
pad is tared or reads about zero.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.arrays import Array

FAR, FAR_N = 20.0, 10.0
"""A pad whose readings exceed this multiple of the least normal force of a contact, and this force in newtons, has an
offset: noise and drift of a tared pad stay far below, and so do most held objects."""
MANY_THRESHOLDS = 10.0
"""With nothing on the pad, half of its taxels read less than this multiple of the threshold of an active taxel."""
AHEAD_NS = 200_000_000
"""Time by which the pad may show a touch before the force sensor measures it, ns."""


class UntaredWatch:
    """Watches the images of a pad without a known zero.

    Args:
        min_normal: Least normal force of a contact, in the unit of the readings if they are forces.
        threshold: Reading from which a taxel is active.
        calibrated: The readings of a pad beside a force sensor are newtons.

    Attributes:
        missing: The pad needs a tare: it reads an impossible load, or one that may be its offset.
    """

    def __init__(self, min_normal: float, threshold: float, *, calibrated: bool = False) -> None:
        self._near = min_normal
        self._far = max(FAR * min_normal, FAR_N)
        self._threshold = threshold
        self._calibrated = calibrated
        self.missing = False
        self._decided = False
        self._high_ns: int | None = None

    def forget(self) -> None:
        """Start over after a change of the zero."""
        self.missing = self._decided = False
        self._high_ns = None

    def update_alone(self, forces: Array) -> None:
        """Update with an image of a pad that is the only sensor of its finger.

        The first image decides: a load that grows later is real. A missing zero is found once the pad reads almost
        nothing.

        Args:
            forces: Force on each taxel, shape (taxels, 3); values that are not finite are ignored.
        """
        if self._decided and not self.missing:
            return
        force = len(forces) * math.hypot(*np.median(forces, axis=0).tolist())  # the median ignores a hot taxel
        if not math.isfinite(force):
            return
        if not self._decided:
            self.missing, self._decided = force > self._far, True
        elif force < self._near:
            self.missing = False

    def update_beside_force(self, readings: Array, t_ns: int, *, free: bool) -> None:
        """Update with an image of a pad beside a force sensor.

        Args:
            readings: Normal reading of each taxel, shape (taxels,).
            t_ns: Time of the image.
            free: The force sensor measures no contact; only then does the image show the pad's zero.
        """
        if not (free and self._reads_much(readings)):
            self._high_ns = None
            self.missing = self.missing and not free
            return
        if self._high_ns is None:
            self._high_ns = t_ns
        self.missing = self.missing or t_ns - self._high_ns > AHEAD_NS

    def _reads_much(self, readings: Array) -> bool:
        if self._calibrated and float(readings.sum()) > self._far:
            return True
        much = readings > MANY_THRESHOLDS * self._threshold
        return self._threshold > 0.0 and 2 * int(np.count_nonzero(much)) > readings.size
