"""What is known of the friction of one contact, what was learned of it, and the friction that limits its rotation."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from slipd.fusion.friction_learning import FADING, KEPT, SCATTER, Z

ONSET_S = 0.3
"""The largest spin of this time before a motion is seen is the one at which it began, s: three looks at images."""
MOST_LN = 7.0
"""Largest absolute logarithm of a coefficient that one run takes over from another: beyond it no friction is real."""
LEAST_SHARE = 0.5
"""A slip with a smaller share of the stated limit is a translation, and teaches nothing of rotation."""


class FrictionState(NamedTuple):
    """Coefficients of friction of one contact; None is unknown.

    Attributes:
        mu: Coefficient of static friction that verdicts use: a lower confidence bound.
        source: Where it comes from: "config", "request" (`friction.set`), "learned", or "none" while it is unknown.
        mu_low: Lower end of the interval in which the coefficient of static friction lies.
        mu_high: Its upper end; None also where only what was carried is known.
        mu_d: Coefficient of dynamic friction.
        carried: Largest required friction that this grasp carried for a while without motion.
        object_name: Name of the object, as a client stated it.
        mu_rotation: Coefficient that limits a rotation, as turns of this grasp showed it; None: ``mu``.
    """

    mu: float | None = None
    source: str = "none"
    mu_low: float | None = None
    mu_high: float | None = None
    mu_d: float | None = None
    carried: float | None = None
    object_name: str | None = None
    mu_rotation: float | None = None

    @property
    def spin_scale(self) -> float:
        """How many times as much friction a spin uses as by ``mu``, ≥ 1."""
        if self.mu is None or self.mu_rotation is None:
            return 1.0
        return max(self.mu / self.mu_rotation, 1.0)


class LogMu(NamedTuple):
    """A coefficient of friction, by mean and variance of its logarithm; NaN: unknown."""

    ln: float = math.nan
    var: float = math.nan

    @property
    def real(self) -> LogMu | None:
        """Itself; None where it cannot be that of friction."""
        return self if abs(self.ln) <= MOST_LN and 0.0 < self.var < math.inf else None


class ObjectFriction(NamedTuple):
    """What earlier grasps taught of an object.

    Attributes:
        ln: Mean of the logarithm of its static and of its dynamic coefficient; NaN: unknown.
        var: Their variances; NaN: unknown.
        floor: Largest required friction that the last grasps carried without motion.
    """

    ln: tuple[float, float] = (math.nan, math.nan)
    var: tuple[float, float] = (math.nan, math.nan)
    floor: float = 0.0

    @property
    def least_mu(self) -> float:
        """Coefficient with which the next grasp of the object begins; NaN: unknown."""
        return math.exp(self.ln[0] - Z * math.sqrt(self.var[0] + 2.0 * SCATTER**2))


class Taught(NamedTuple):
    """What was learned of one coefficient.

    Attributes:
        slips: By the slips of the present grasp, the newest last; None: one that was disproved since.
        earlier: By earlier grasps of the named object; None: nothing.
    """

    slips: tuple[LogMu | None, ...]
    earlier: LogMu | None


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
        if not required >= LEAST_SHARE * self.stated:  # NaN: the spin of a reading is not known
            return
        if same and self._samples:
            self._samples[-1] = max(self._samples[-1], required)
        else:
            self._samples.append(required)
        weights = [FADING**age for age in range(len(self._samples) - 1, -1, -1)]
        logs = sum(weight * math.log(sample) for weight, sample in zip(weights, self._samples, strict=True))
        self.learned = math.exp(logs / sum(weights))
