"""Friction in use for the object in the grip: from the config, as a client stated it, or learned in the grasp."""

from __future__ import annotations

from slipd.config import Finger as FingerConfig
from slipd.friction.friction_estimate import FrictionEstimate
from slipd.friction.friction_state import FrictionState
from slipd.friction.rotation_friction import RotationFriction

SEEN_SHARE = 0.5
"""Part of the fall from static to dynamic friction that must be seen before it counts as slip."""
LEAST_DROP = 0.01
"""Least relative fall that counts as slip: less is no fall."""


class Friction:
    """Coefficients of friction of one finger's contact: stated by the config or a client, and learned in the grasp.

    Args:
        config: ``[finger.X]``.

    Attributes:
        drop: Least relative fall of the required friction that counts as slip: that of the config, or less.
        set_by: Client that set the coefficients last; None: only the config did.
        set_t_ns: When it did, CLOCK_MONOTONIC; None likewise.
        estimate: What is learned.
        rotation: What is learned of rotation, where that has a coefficient of its own.
        stated: Coefficient of static friction by config or client; None: unknown.
    """

    def __init__(self, config: FingerConfig) -> None:
        self.drop = self._most_drop = config.slip.drop
        self.set_by: str | None = None
        self.set_t_ns: int | None = None
        self.estimate = FrictionEstimate(config.mu, config.mu_spread, config.most_mu)
        self.rotation = RotationFriction(config.mu_rotation)
        self.stated = config.mu

    @property
    def state(self) -> FrictionState:
        """What is known now."""
        state, learned = self.estimate.state, self.rotation.learned
        return state if learned is None else state._replace(mu_rotation=learned)

    def doubt(self) -> None:
        """Forget what was learned with another zero, unless it is stricter; see `FrictionEstimate.doubt`."""
        self.estimate.doubt()

    @property
    def mu(self) -> float | None:
        """Coefficient of static friction in use; None: unknown."""
        return self.estimate.state.mu

    @property
    def source(self) -> str:
        """Where μ comes from: "config", "request", "learned", or "none" while it is unknown."""
        return self.estimate.state.source

    def set(self, mu_s: float, mu_d: float | None, by: str, t_ns: int | None) -> None:
        """Use the coefficients that a client states, for the rest of the run, and forget what was learned.

        Args:
            mu_s: Coefficient of static friction.
            mu_d: Coefficient of dynamic friction; None: the fall that counts as slip stays as it is.
            by: The client.
            t_ns: Now, CLOCK_MONOTONIC.
        """
        if mu_d is not None:
            self.drop = self._drop(mu_s, mu_d)
        self.stated = mu_s
        self.rotation.forget()
        self.estimate.restart(mu_s, mu_d, "request")
        self.set_by, self.set_t_ns = by, t_ns

    @property
    def strictest(self) -> float | None:
        """Least μ that is in use, stated, or known of a named object; None: unknown, now or with the next grasp."""
        if self.mu is None or self.stated is None:
            return None
        return min(self.mu, self.stated, self.estimate.least_known)

    def is_more_lenient(self, mu_s: float, mu_d: float | None) -> bool:
        """Return whether these coefficients would make a verdict more lenient, in this grasp or a later one.

        A larger μ does, and so does a larger fall before a slip is reported.
        """
        if self.strictest is None or mu_s > self.strictest:
            return True
        return mu_d is not None and self._drop(mu_s, mu_d) > self.drop

    def _drop(self, mu_s: float, mu_d: float) -> float:
        """Return the least relative fall that counts as slip for these coefficients."""
        return min(max(SEEN_SHARE * (1.0 - mu_d / mu_s), LEAST_DROP), self._most_drop)
