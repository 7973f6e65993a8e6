"""Motion of the object in a grasp by pads that measure the force themselves, from the images of all of them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from slipd.config import Levels
from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.motion.evidence import Evidence
from slipd.motion.image_step import LOOKS_PER_HOUR, ImageStep
from slipd.motion.load_belief import LoadBelief
from slipd.motion.risk import MotionRisk

REPORTED_NS = 300_000_000
"""Motion stays reported for this long after the last look that showed it: three looks of a pad with 10 new images a
second, after which the object rests."""
SENSES = 1.0, -1.0
"""Signs of the spin of one twist of the object on the first and the second pad, which face each other."""


class PadMotion:
    """Looks at the pads of a grasp for motion of the object.

    Args:
        fingers: The one or two fingers whose pad measures the force.
        false_alarms_per_hour: How often a hold may be reported as motion, 1/h.
    """

    def __init__(self, fingers: Sequence[Finger], false_alarms_per_hour: float) -> None:
        self._fingers = fingers
        self._risk = MotionRisk(false_alarms_per_hour, {"image_change": LOOKS_PER_HOUR})
        self._step = ImageStep()
        self._belief = LoadBelief()

    def update(self, t_ns: int) -> list[tuple[Finger, FingerState]]:
        """Look after an image acquired at ``t_ns``; return the state of every finger that now reports motion."""
        images = [finger.image for finger in self._fingers]
        loads = [_load(finger) for finger in self._fingers]
        known = [load for load in loads if load is not None]
        if len(known) < len(loads):
            self._forget()
            return []
        if any(image is None or image.t_ns != t_ns for image in images):
            return []  # the other pad's image of this time is still to come
        surprise = self._step.update([image.pressure for image in images if image is not None], t_ns)
        if surprise is None:
            return []
        spin = sum(sense * load[0] for sense, load in zip(SENSES, known, strict=False)) / len(known)
        whole = sum(load[1] for load in known) / len(known)
        kinds = self._risk.update(Evidence("image_change", t_ns, surprise), self._belief.update(spin, whole))
        if not kinds:
            return []
        self._belief.forget_carried()
        found = [(finger, finger.note_motion(t_ns + REPORTED_NS, kinds)) for finger in self._fingers]
        return [(finger, state) for finger, state in found if state is not None]

    def _forget(self) -> None:
        self._risk.forget()
        self._step.forget()
        self._belief.forget()


def make_pad_motion(levels: Levels, fingers: Sequence[Finger]) -> PadMotion | None:
    """Make the look at all pads; None where a finger has a force sensor, or no pad that measures the force."""
    alone = all(finger.force is None and finger.image is not None and finger.image.three_axis for finger in fingers)
    return PadMotion(fingers, levels.false_alarms_per_hour) if alone and len(fingers) <= len(SENSES) else None


def _load(finger: Finger) -> tuple[float, float] | None:
    """Return utilisation by the spin alone, signed, and by the whole load; 0 for both where no friction is stated.

    None without a contact and an image of it, or where the readings are not trusted. The stated friction counts, not
    what this grasp taught: a look is compared with what was carried before it.
    """
    state, friction = finger.state, finger.friction
    contact, distribution = state.contact, state.load_distribution
    if contact is None or distribution is None or math.isnan(contact.spin_nm) or not finger.is_trusted:
        return None
    stated, used = friction.stated, state.utilisation
    if stated is None or friction.mu is None or used is None or not math.isfinite(used.value):
        return 0.0, 0.0
    x, y, loads = distribution.x - contact.cx_m, distribution.y - contact.cy_m, distribution.loads.loads
    lever_m = float(loads @ np.hypot(x, y))
    limit = (finger.config.mu_rotation or stated) * contact.normal_n * lever_m
    return contact.spin_nm / limit if lever_m > 0.0 else 0.0, used.value * friction.mu / stated
