"""Learn the friction that limits a rotation, where the gains of shear and pressure are not calibrated.

Raw counts of three-axis taxels are dominated by the pressure: their tangential force says little of friction, so slips
teach no μ. The spin is a difference across the pad, in which that cancels. Over 170 turns of held boxes, spin /
(f_n × mean lever of the load) was within 30 % of its median for one box, and differed by 1.6 between boxes.
"""

from __future__ import annotations

import math
from collections import deque

from slipd.friction.learning import FADING, KEPT

ONSET_S = 0.3
"""The largest spin of this time before a motion is seen is the one at which it began, s: three looks at images."""
LEAST_SHARE = 0.5
"""A slip with a smaller share of the stated limit is a translation, and teaches nothing of rotation."""


class RotationFriction:
    """Friction against rotation in one contact: nothing until the object turned, then what the turns showed.

    Args:
        stated: ``mu_rotation`` of the config; None: μ limits rotation too, and nothing is learned here.

    Attributes:
        stated: As given.
        learned: Required coefficient at which the object turned, newer turns with more weight; None before one.
    """

    def __init__(self, stated: float | None) -> None:
        self.stated = stated
        self._recent: deque[tuple[float, float]] = deque()
        self.forget()

    def forget(self) -> None:
        """Forget the grasp: it ended, or is no longer known."""
        self._recent.clear()
        self._samples: deque[float] = deque(maxlen=KEPT)
        self._slips_until_s = -math.inf
        self.learned: float | None = None

    def carry(self, t_s: float, required: float) -> None:
        """Add a reading.

        Args:
            t_s: When it was acquired, s.
            required: Coefficient that its spin requires, |m| / (f_n × mean lever of the load).
        """
        self._recent.append((t_s, required))
        while self._recent[0][0] < t_s - ONSET_S:
            self._recent.popleft()

    def slip(self, until_s: float) -> None:
        """Learn from the newest readings: the object moves, and counts as moving until ``until_s``."""
        if self.stated is None or not self._recent:
            return
        required = max(required for _, required in self._recent)
        same = self._recent[-1][0] <= self._slips_until_s
        self._slips_until_s = until_s
        if required < LEAST_SHARE * self.stated:
            return
        if same and self._samples:
            self._samples[-1] = max(self._samples[-1], required)
        else:
            self._samples.append(required)
        weights = [FADING**age for age in range(len(self._samples) - 1, -1, -1)]
        logs = sum(weight * math.log(sample) for weight, sample in zip(weights, self._samples, strict=True))
        self.learned = math.exp(logs / sum(weights))
