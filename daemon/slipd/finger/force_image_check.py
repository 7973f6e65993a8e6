"""Compare force sensor and pad of one finger: both should see the same contact."""

from __future__ import annotations

import math

from slipd.config import Finger as FingerConfig
from slipd.config import Pad
from slipd.finger.contact_estimator import ContactEstimator
from slipd.finger.force_channel import ForceChannel
from slipd.finger.force_history import ForceHistory
from slipd.finger.image_channel import ImageChannel
from slipd.fusion import Contact
from slipd.fusion.contact import contact_of
from slipd.fusion.levels import Uncertainty
from slipd.signals.force_image_agreement import STDS, Agreement

COMPARE_NS = 10_000_000
"""At most one comparison in this time: a disagreement counts only once it has lasted for longer."""


class ForceImageCheck:
    """What force sensor and image of one finger contradict each other about.

    Args:
        config: ``[finger.X]``.
        pad: ``[finger.X.pad]``.
        force: The force sensor.
        image: The pad.

    Attributes:
        history: Force readings of the recent past.
        disagreement: Reasons of a verdict: "disagreement_contact", "disagreement_centroid", "disagreement_force".
    """

    def __init__(self, config: FingerConfig, pad: Pad, force: ForceChannel, image: ImageChannel) -> None:
        self._force, self._image = force, image
        self.history = ForceHistory(force.noise.force_std_n)
        self._agreement = Agreement(pad.rows, pad.cols, pad.pitch_m, config.min_normal_n, pad.gain_error)
        self._compared_ns = 0
        self.disagreement: tuple[str, ...] = ()

    def update_image(self, t_ns: int, estimator: ContactEstimator, *, known: bool) -> None:
        """Compare the newest image with the force at its time.

        Args:
            t_ns: When the image was acquired.
            estimator: Knows the least normal force that counts as contact.
            known: The newest force is known.
        """
        image = self._image
        if not (known and image.is_independent):
            self.reset()
            return
        if t_ns - self._compared_ns < COMPARE_NS:
            return
        self._compared_ns = t_ns
        uncertainty = self._force.uncertainty(t_ns)
        contact = _contact(self.history.wrench_at(t_ns), uncertainty, estimator.least_normal_n)
        found = self._agreement.update(
            t_ns, contact, uncertainty.force_std_n + uncertainty.force_n, image.x, image.y, image.pressure
        )
        self.disagreement = tuple(f"disagreement_{what}" for what in found)

    def reset(self) -> None:
        """Forget what was compared: the contact or a stream ended."""
        self.disagreement = ()
        self._agreement.reset()


def _contact(wrench: tuple[float, ...], uncertainty: Uncertainty, least_normal_n: float) -> Contact:
    """Return the contact by the force sensor; without torque its centroid and spin are NaN.

    What the unknown weight of the finger may add counts fully: `Agreement` allows ``STDS`` standard deviations.
    """
    force_std_n = uncertainty.force_std_n + uncertainty.force_n / STDS
    torque_std_nm = uncertainty.torque_std_nm + uncertainty.torque_nm / STDS
    fx, fy, fz, *torque = wrench
    if math.isnan(torque[0]):
        contact = contact_of((fx, fy, fz, 0.0, 0.0, 0.0), least_normal_n, force_std_n, torque_std_nm)
        nan = math.nan
        return contact._replace(cx_m=nan, cy_m=nan, cx_std_m=nan, cy_std_m=nan, spin_nm=nan)
    return contact_of((fx, fy, fz, *torque), least_normal_n, force_std_n, torque_std_nm)
