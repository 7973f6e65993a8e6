"""Where the pads of a grasp are, at each width between them."""

from __future__ import annotations

import numpy as np

from slipd.config import PadPlace
from slipd.fusion.grasp import PadPose
from slipd.types.arrays import Array, rotation_matrix


class Place:
    """Pose of a pad at each width, from ``[grasp.pads.X]``.

    Attributes:
        rotation: Maps pad coordinates to gripper coordinates, shape (3, 3).
    """

    def __init__(self, config: PadPlace) -> None:
        self.rotation = rotation_matrix(config.quat_xyzw)
        rows = np.array(config.positions)
        self._widths_m, self._positions_m = rows[:, 0], rows[:, 1:]

    def pose(self, width_m: float | None) -> PadPose:
        """Return the pose; without a position where the width is unknown or outside the configured positions."""
        widths = self._widths_m
        if width_m is None or not widths[0] <= width_m <= widths[-1]:
            return PadPose(self.rotation, None)
        return PadPose(self.rotation, self.nearest_m(width_m))

    def nearest_m(self, width_m: float | None) -> Array:
        """Return the position, shape (3,), m; the nearest configured one beyond them, the middle one where unknown."""
        widths = self._widths_m
        at_m = (widths[0] + widths[-1]) / 2.0 if width_m is None else width_m
        return np.array([np.interp(at_m, widths, along) for along in self._positions_m.T])
