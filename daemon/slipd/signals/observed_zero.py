"""Judge the zero of a pad in front of a force sensor, while that sensor measures no contact.

Raw counts may have any offset. A pad that reads nothing while it is free has a right zero; one that reads a load then
has a wrong one.
"""

from __future__ import annotations

import numpy as np

from slipd.types.arrays import Array

HELD_NS = 200_000_000
"""Time for which a free pad must read the same: it may show a touch before the force sensor measures it, ns."""
MANY_THRESHOLDS = 10.0
"""A free pad with a right zero reads less than this multiple of the threshold on half of its taxels, drift included."""


class ObservedZero:
    """Watches the images of a pad.

    Args:
        threshold: Reading from which a taxel is active.

    Attributes:
        right: The pad has been free and read nothing.
        wrong: The pad is free and reads a load.
    """

    def __init__(self, threshold: float) -> None:
        self._threshold = threshold
        self.right = self.wrong = False
        self._reads = ""
        self._since_ns = 0

    def update(self, readings: Array, t_ns: int, *, free: bool) -> None:
        """Update with an image.

        Args:
            readings: Normal reading of each taxel, shape (taxels,).
            t_ns: Time of the image.
            free: The force sensor, whose zero is known, measures no contact.
        """
        reads = self._kind(readings) if free else ""
        if reads != self._reads:
            self._reads, self._since_ns = reads, t_ns
        lasts = t_ns - self._since_ns > HELD_NS
        self.right, self.wrong = lasts and reads == "nothing", lasts and reads == "load"

    def _kind(self, readings: Array) -> str:
        """Return what a free pad reads: "nothing", "load", or "" where it is neither."""
        size = np.abs(readings)
        if (size <= self._threshold).all():
            return "nothing"
        many = 2 * int(np.count_nonzero(size > MANY_THRESHOLDS * self._threshold)) > size.size
        return "load" if many and self._threshold > 0.0 else ""
