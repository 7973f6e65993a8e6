"""Evidence of motion from the sensors of one finger beside its load: its image, and the high band of its force."""

from __future__ import annotations

import math

import numpy as np

from slipd.config import Wrench
from slipd.finger.finger_state import VerdictBatch
from slipd.finger.image_channel import ImageChannel
from slipd.fusion.rows import Rows
from slipd.motion.evidence import Evidence
from slipd.motion.image_blocks import LoadNoise
from slipd.motion.image_shift import ImageShift
from slipd.motion.vibration import BLOCK, LEAST_HZ, Vibration


class ContactMotion:
    """Looks for motion in the readings of a force sensor and the images of the pad in front of it.

    Args:
        wrench: ``[finger.X.wrench]``.
        image: The pad; None where there is none.

    Attributes:
        looks_per_hour: Of each kind of evidence that the sensors can give.
        found: Evidence that was found since the last `take`.
    """

    def __init__(self, wrench: Wrench, image: ImageChannel | None) -> None:
        self._shift: ImageShift | None = None
        self._vibration: Vibration | None = None
        self.found: list[Evidence] = []
        self.looks_per_hour: dict[str, float] = {}
        self._known = False  # a contact
        self._rows: list[Rows] = []
        self._count = 0
        if image is not None and not image.three_axis:
            lever_m = math.hypot(*wrench.pad_from_sensor.xyz_m)
            torque_nm = math.hypot(wrench.torque_std_nm, lever_m * wrench.force_std_n)
            self._shift = ImageShift(image.geometry, LoadNoise(wrench.force_std_n, torque_nm))
            self.looks_per_hour["image_change"] = self._shift.looks_per_hour
        if wrench.rate_hz >= LEAST_HZ:
            self._vibration = Vibration(wrench.rate_hz)
            self.looks_per_hour["vibration"] = self._vibration.looks_per_hour

    def update_force(self, batch: VerdictBatch) -> None:
        """Update with the force readings of one read."""
        if not batch.touches:
            self.forget()
            return
        self._known = True
        if self._vibration is None:
            return
        rows = batch.readings.rows
        self._rows.append(rows)
        self._count += len(rows)
        if self._count >= BLOCK:  # nothing is computed before, because a reading has no time for it
            wrenches = np.concatenate([rows["wrench"] for rows in self._rows])
            self._rows, self._count = [], 0
            found = self._vibration.update(batch.readings.times_ns[-1], wrenches)
            if found is not None:
                self.found.append(found)

    def update_image(self, image: ImageChannel, t_ns: int, wrench: tuple[float, ...]) -> None:
        """Update with an image of a contact.

        Args:
            image: The pad, with a usable image.
            t_ns: When it was acquired, CLOCK_MONOTONIC.
            wrench: By the force sensor since the image before, in the pad frame: N and N·m, six numbers.
        """
        if self._shift is None:
            return
        self._known = True
        found = self._shift.update(t_ns, image.loads, wrench, image.taxel_health.measured)
        if found is not None:
            self.found.append(found)

    def forget(self) -> None:
        """Forget everything: the contact ended, or is not known."""
        if not self._known:
            return
        self._known = False
        self.found.clear()
        self._rows, self._count = [], 0
        if self._vibration is not None:
            self._vibration.reset()
        self.forget_image()

    def forget_image(self) -> None:
        """Forget the images: they cannot be used."""
        if self._shift is not None:
            self._shift.reset()

    def take(self) -> list[Evidence]:
        """Return the evidence that was found, and forget it."""
        found, self.found = self.found, []
        return found

    def confirm(self) -> int:
        """Take the newest evidence of the image as true; return until when the contact counts as moving, ns.

        Raises:
            ValueError: The images gave no evidence.
        """
        if self._shift is None:
            raise ValueError("a finger without images has no evidence of them")
        return self._shift.confirm()
