"""Detect a clearly negative normal force, and say what to check.

Nothing pulls on a pad: such a force means a wrong sign, a wrong mounting, or a wrong configuration of the sensor.
"""

from __future__ import annotations

from slipd.config import Finger
from slipd.fusion.levels import Uncertainty
from slipd.signals.force_image_agreement import CLEAR, STDS

LARGEST_BIAS_N = 10.0
"""A force sensor may read this much without load before its first tare, N."""


class NegativeForceDetector:
    """Limit of the negative normal force beyond which only a fault explains it.

    The zero of a force sensor may drift by the least normal force of a contact plus the drift that is compensated, that
    of a pad by twice that force plus the threshold of each taxel.

    Args:
        finger: ``[finger.X]``.
    """

    def __init__(self, finger: Finger) -> None:
        wrench, pad = finger.wrench, finger.pad
        self._by_force = wrench is not None
        if wrench is not None:
            self._drift_n = finger.min_normal_n + wrench.drift_limit_n
        else:
            taxels = 0 if pad is None else pad.rows * pad.cols
            self._drift_n = CLEAR * finger.min_normal_n + taxels * (0.0 if pad is None else pad.threshold)

    def least_n(self, uncertainty: Uncertainty, *, tared: bool) -> float:
        """Return the least negative force that drift, noise, unknown weight and (before a tare) bias do not explain.

        Args:
            uncertainty: Of the reading.
            tared: A tare was taken.

        Returns:
            Its absolute value, in the unit of the readings: N, or that of a pad without calibration.
        """
        least_n = self._drift_n + STDS * uncertainty.force_std_n + uncertainty.force_n
        return least_n if tared or not self._by_force else least_n + LARGEST_BIAS_N

    def advice(self, normal_n: float, *, tared: bool, pressed: bool | None) -> str:
        """Return what people should check.

        Args:
            normal_n: Normal force, N; negative.
            tared: The force has a known zero.
            pressed: The image of the pad shows a contact; None: unknown.
        """
        text = f"its normal force is {normal_n:.6g} N, and nothing pulls on a pad: check "
        if not self._by_force:
            return text + "the signs of axis_scale, and tare it"
        text += "sign, pad_from_sensor (quat_xyzw is in the order x, y, z, w) and the sensor's own configuration"
        if pressed:
            return text + "; the pad image shows a contact, so the force sensor is wrong"
        return text if tared else text + "; if it is the bias of an unloaded sensor, tare it with unloaded = true"
