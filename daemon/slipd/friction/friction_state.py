"""What is known of the friction of one contact, and what was learned of it."""

from __future__ import annotations

from typing import NamedTuple


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
        """How many times as much friction a spin uses as ``mu`` says, ≥ 1."""
        if self.mu is None or self.mu_rotation is None:
            return 1.0
        return max(self.mu / self.mu_rotation, 1.0)


class Taught(NamedTuple):
    """What was learned of one coefficient; each pair is the mean and the variance of its logarithm.

    Attributes:
        slips: By the slips of the present grasp, the newest last; None: one that was disproved since.
        earlier: By earlier grasps of the named object; None: nothing.
    """

    slips: tuple[tuple[float, float] | None, ...]
    earlier: tuple[float, float] | None
