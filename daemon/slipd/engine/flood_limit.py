"""Limit of the readings that a device may send: the oldest of a flood are dropped."""

from __future__ import annotations

from collections.abc import Sequence

from slipd.types.samples import Sample

FLOOD_FACTOR = 4.0
"""Multiple of its expected rate at which a device floods; a rate in a config is easily wrong by two."""
BURST_S = 1.0
"""Readings that may arrive at once after a stall of the daemon, as time at the expected rate."""
LEAST_BURST = 32.0
"""Least number of readings that may arrive at once: slow streams come in bunches too."""


class FloodLimit:
    """The readings that one link may bring now: a store that fills at a multiple of the expected rate.

    Attributes:
        rate_hz: Expected rate of all streams of the link, Hz.
        dropped: Readings dropped since the daemon began.
        dropped_ns: When readings were dropped last; None: never.
    """

    def __init__(self) -> None:
        self.rate_hz = 0.0
        self.dropped = 0
        self.dropped_ns: int | None = None
        self._allowed = 0.0
        self._allowed_ns = 0

    def open(self, t_ns: int) -> None:
        """Begin with a full store on a link opened at ``t_ns``."""
        self._allowed_ns, self._allowed = t_ns, self._burst()

    def limit(self, samples: Sequence[Sample], t_ns: int) -> Sequence[Sample]:
        """Return the readings received at ``t_ns`` without the oldest that exceed the limit."""
        if len(samples) > self._allowed:
            samples = self._within_rate(samples, t_ns)
        self._allowed -= len(samples)
        return samples

    def _within_rate(self, samples: Sequence[Sample], t_ns: int) -> Sequence[Sample]:
        refill = (t_ns - self._allowed_ns) * 1e-9 * FLOOD_FACTOR * self.rate_hz
        self._allowed, self._allowed_ns = min(self._allowed + refill, self._burst()), t_ns
        surplus = len(samples) - int(self._allowed)
        if surplus <= 0:
            return samples
        self.dropped += surplus
        self.dropped_ns = t_ns
        return samples[surplus:]

    def _burst(self) -> float:
        return max(BURST_S * self.rate_hz, LEAST_BURST)
