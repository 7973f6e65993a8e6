"""Friction in use for the object in the grip: from the config, or as a client stated it."""

from __future__ import annotations

SEEN_SHARE = 0.5
"""Part of the fall from static to dynamic friction that must be seen before it counts as slip."""
LEAST_DROP = 0.05
"""Least relative fall that counts as slip: noise may bring less."""


class Friction:
    """Coefficients of friction of one finger's contact, and who set them.

    Args:
        mu: Coefficient of static friction by the config; None: unknown.
        drop: Relative fall of the friction ratio that counts as slip, by the config.

    Attributes:
        mu: Coefficient of static friction in use; None: unknown.
        drop: Relative fall of the friction ratio R that counts as slip.
        set_by: Client that set the coefficients last; None: only the config did.
        set_t_ns: When it did, CLOCK_MONOTONIC; None likewise.
    """

    def __init__(self, mu: float | None, drop: float) -> None:
        self.mu = mu
        self.drop = drop
        self._source = "config"
        self.set_by: str | None = None
        self.set_t_ns: int | None = None

    @property
    def source(self) -> str | None:
        """Where μ comes from: "config" or "request"; None while it is unknown."""
        return None if self.mu is None else self._source

    def set(self, mu_s: float, mu_d: float | None, by: str, t_ns: int | None) -> None:
        """Use the coefficients that a client states, for the rest of the run.

        Args:
            mu_s: Coefficient of static friction.
            mu_d: Coefficient of dynamic friction; None: the fall that counts as slip stays as it is.
            by: The client.
            t_ns: Now, CLOCK_MONOTONIC.
        """
        self.mu = mu_s
        if mu_d is not None:
            self.drop = _drop(mu_s, mu_d)
        self._source = "request"
        self.set_by, self.set_t_ns = by, t_ns

    def is_more_lenient(self, mu_s: float, mu_d: float | None) -> bool:
        """Return whether these coefficients would make a verdict more lenient than those in use.

        A larger μ does, and so does a larger fall before a slip is reported.
        """
        if self.mu is None or mu_s > self.mu:
            return True
        return mu_d is not None and _drop(mu_s, mu_d) > self.drop


def _drop(mu_s: float, mu_d: float) -> float:
    """Return the relative fall of the friction ratio that counts as slip for these coefficients."""
    return max(SEEN_SHARE * (1.0 - mu_d / mu_s), LEAST_DROP)
