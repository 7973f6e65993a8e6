"""Evidence that the object moves in a grasp by pads that measure the force themselves, from all of them together.

`slipd.engine.held_motion` judges it with all other evidence.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from slipd.finger.finger import Finger
from slipd.motion.evidence import Evidence
from slipd.motion.pad_looks import LOOKS_PER_HOUR, ImageStep, LoadBelief, belong_together

LEAST_SURPRISE = 1.0
"""The load counts only beside an image that changes by more than that of a hold does in the mean: a pad that is still
shows no motion, however near the limit its load is. By the definition of `slipd.motion.pad_looks.BACKGROUND`."""
SENSES = 1.0, -1.0
"""Signs of the spin of one twist of the object on the first and the second pad, which face each other."""


class PadMotion:
    """Looks at the pads of a grasp for motion of the object.

    Args:
        fingers: The one or two fingers whose pad measures the force.
    """

    looks_per_hour = LOOKS_PER_HOUR

    def __init__(self, fingers: Sequence[Finger]) -> None:
        self._fingers = fingers
        self._period_ns = max(1e9 / finger.config.pad.rate_hz for finger in fingers if finger.config.pad is not None)
        self._step, self._belief = ImageStep(), LoadBelief()

    def update(self) -> tuple[Evidence, float] | None:
        """Look after an image of a pad.

        Returns:
            Evidence, and the odds of motion by the load alone, in nats. None where this is no look.
        """
        images = [finger.image for finger in self._fingers if finger.image is not None]
        loads = [load for finger in self._fingers if (load := _load(finger)) is not None]
        times_ns = [image.t_ns for image in images if image.t_ns is not None]
        if not len(loads) == len(times_ns) == len(self._fingers):
            self._step.forget()
            self._belief.forget()
            return None
        if not belong_together(times_ns, self._period_ns):
            return None  # the other pad's image of this time is still to come
        t_ns = max(times_ns)
        surprise = self._step.update([image.pressure for image in images], t_ns)
        if surprise is None:
            return None
        spin = sum(sense * load[0] for sense, load in zip(SENSES, loads, strict=False)) / len(loads)
        tangential = sum(load[1] for load in loads) / len(loads)
        belief = self._belief.update(spin, tangential)
        return Evidence("image_change", t_ns, surprise), belief if surprise > LEAST_SURPRISE else 0.0

    def confirm(self) -> None:
        """Take the newest evidence as true: the object lies otherwise now, and what was carried before says nothing."""
        self._belief.forget_carried()


def make_pad_motion(fingers: Sequence[Finger]) -> PadMotion | None:
    """Make the look at all pads; None where a finger has a force sensor, or no pad that measures the force."""
    alone = all(finger.force is None and finger.image is not None and finger.image.three_axis for finger in fingers)
    return PadMotion(fingers) if alone and len(fingers) <= len(SENSES) else None


def _load(finger: Finger) -> tuple[float, float] | None:
    """Return utilisation by the spin, signed, and by the tangential force; 0 for both where no friction is stated.

    None without a contact and an image of it, or where the readings are not trusted. The stated friction counts, not
    what this grasp taught: a look is compared with what was carried before it.
    """
    contact, distribution, friction = finger.state.contact, finger.state.load_distribution, finger.friction
    if contact is None or distribution is None or math.isnan(contact.spin_nm) or not finger.trust.newest:
        return None
    stated = friction.stated
    if stated is None:
        return 0.0, 0.0
    return distribution.spin_required(contact) / (friction.rotation.stated or stated), contact.friction_ratio / stated
