"""Evidence of motion in the images of one finger, beside the load that its force sensor measures."""

from __future__ import annotations

import math

from slipd.config import Wrench
from slipd.finger.image_channel import ImageChannel
from slipd.motion.evidence import Evidence
from slipd.motion.image_blocks import LoadNoise
from slipd.motion.image_shift import ImageShift


class ContactMotion:
    """Looks for motion in the images of the pad in front of a force sensor.

    Args:
        wrench: ``[finger.X.wrench]``.
        image: The pad, which measures the normal force.

    Attributes:
        looks_per_hour: How many independent looks it takes in an hour.
        found: Evidence that was found since the last `pop_found`.
    """

    def __init__(self, wrench: Wrench, image: ImageChannel) -> None:
        lever_m = math.hypot(*wrench.pad_from_sensor.xyz_m)
        torque_nm = math.hypot(wrench.torque_std_nm, lever_m * wrench.force_std_n)
        self._shift = ImageShift(image.geometry, LoadNoise(wrench.force_std_n, torque_nm))
        self.looks_per_hour = self._shift.looks_per_hour
        self.found: list[Evidence] = []
        self._known = False  # an image of this contact

    def update(self, image: ImageChannel, t_ns: int, wrench: tuple[float, ...]) -> None:
        """Update with an image of a contact.

        Args:
            image: The pad, with a usable image.
            t_ns: When it was acquired, CLOCK_MONOTONIC.
            wrench: By the force sensor since the image before, in the pad frame: N and N·m, six numbers.
        """
        self._known = True
        found = self._shift.update(t_ns, image.loads, wrench, image.taxel_health.measured)
        if found is not None:
            self.found.append(found)

    def forget(self) -> None:
        """Forget the contact: it ended, or is not known."""
        if self._known:
            self._known = False
            self.found.clear()
            self._shift.reset()

    def forget_images(self) -> None:
        """Forget the images, which cannot be used, but not what they showed."""
        self._shift.reset()

    def pop_found(self) -> list[Evidence]:
        """Remove and return the evidence that was found."""
        found, self.found = self.found, []
        return found

    def confirm(self) -> int:
        """Take the newest evidence as true; return until when the contact counts as moving, ns.

        Raises:
            ValueError: There was no evidence.
        """
        return self._shift.confirm()
