"""The force side of one finger: from the readings of its force/torque sensor to the force on the pad."""

from __future__ import annotations

import math

import numpy as np

from slipd.config import Wrench
from slipd.samples import Array, WrenchSample
from slipd.signals.mounting import Mounting
from slipd.signals.tare import Tare

_UNKNOWN = (math.nan, math.nan, math.nan)


class ForceSide:
    """A force/torque sensor behind a pad.

    Args:
        wrench: ``[finger.X.wrench]``.

    Attributes:
        tare: Offset of the readings, in the sensor's own frame.
    """

    def __init__(self, wrench: Wrench) -> None:
        self.tare = Tare(np.zeros(6))
        mounting = Mounting(wrench.pad_from_sensor.xyz_m, wrench.pad_from_sensor.quat_xyzw, wrench.sign)
        self._to_pad: Array = np.column_stack([np.concatenate(mounting.to_pad(e[:3], e[3:])) for e in np.eye(6)])
        self.noise = (wrench.force_std_n, wrench.torque_std_nm)

    def take(self, sample: WrenchSample, *, trusted: bool) -> tuple[float, ...] | None:
        """Takes a reading.

        Returns:
            Force on the finger in the pad frame, N, and torque about the pad's origin, N·m; the torque is NaN where the
            sensor measures none. None where a number of the reading is not finite: it touches no state.
        """
        torque = sample.torque_nm
        numbers = sample.force_n.tolist() + ([0.0, 0.0, 0.0] if torque is None else torque.tolist())
        if not math.isfinite(sum(numbers)):
            return None
        raw = self.tare.apply(np.array(numbers), sample.t_ns, trusted=trusted)
        wrench = (self._to_pad @ raw).tolist()
        return tuple(wrench) if torque is not None else (*wrench[:3], *_UNKNOWN)
