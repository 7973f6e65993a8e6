"""Detect images that look fresh and are not: they repeat bit for bit while the force on the pad changes."""

from __future__ import annotations

import math

from slipd.types.arrays import Array

FROZEN_IMAGES = 3
"""Number of images in a row that equal the one before. XELA's server repeats 7 % of its images, never two in a row."""
FROZEN_NS = 85_000_000
"""Least time since the last new image: with three repeats, 100 ms at 30 Hz and more, jitter included."""


class FrozenImage:
    """Detects a tactile array that hangs: its image stays the same while the force on it changes.

    Args:
        force_step_n: Change of the normal force that the image must show, N: several times the noise of the force
            sensor, and enough to change a reading of the pad by several counts.

    Attributes:
        suspect: The newest image repeats the one before although the force changed. It may have been sent twice; no
            grip is raised on it.
    """

    def __init__(self, force_step_n: float) -> None:
        if not 0.0 < force_step_n < math.inf:
            raise ValueError(f"force_step_n must be positive and finite, got {force_step_n}")
        self._step_n = force_step_n
        self._bits = b""
        self._repeats = 0
        self._since_ns = 0
        self._low_n, self._high_n = math.inf, -math.inf
        self.suspect = False

    def update(self, values: Array, t_ns: int, normal_n: float | None) -> bool:
        """Update with an image; return whether the array hangs.

        Args:
            values: Readings as received, any shape.
            t_ns: Time of the image.
            normal_n: Normal force of the force sensor, N; None or NaN if not known. Without it no pad is reported:
                a pad without noise may rest as long as its load.
        """
        bits = values.tobytes()
        if bits != self._bits:
            self._bits, self._repeats, self._since_ns = bits, 0, t_ns
            self._low_n, self._high_n = math.inf, -math.inf
        else:
            self._repeats += 1
        if normal_n is not None:
            if normal_n < self._low_n:
                self._low_n = normal_n
            if normal_n > self._high_n:
                self._high_n = normal_n
        self.suspect = self._repeats > 0 and self._high_n - self._low_n >= self._step_n
        return self.suspect and self._repeats >= FROZEN_IMAGES and t_ns - self._since_ns >= FROZEN_NS
