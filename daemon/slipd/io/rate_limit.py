"""Limit how often something happens: requests and subscriptions of a client, lines of the log."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable

MOST_KEYS = 1024
"""Keys remembered. The key that was silent for longest is forgotten first, and starts again with a full bucket."""


class RateLimit:
    """A token bucket for each key, such as a client.

    Args:
        per_second: Long-term rate of one key, 1/s.
        burst: How many pass at once after a silence; None: those of a second, and at least one.
        most_keys: Keys remembered.
    """

    def __init__(self, per_second: float, burst: float | None = None, most_keys: int = MOST_KEYS) -> None:
        self._per_s = per_second
        self._burst = max(per_second, 1.0) if burst is None else burst
        self._most_keys = most_keys
        self._buckets: OrderedDict[Hashable, tuple[float, int]] = OrderedDict()  # tokens, and the time of their count

    def allows(self, key: Hashable, t_ns: int) -> bool:
        """Return whether one more passes at ``t_ns``; if so, count it."""
        tokens, counted_ns = self._buckets.pop(key, (self._burst, t_ns))
        tokens = min(self._burst, tokens + (t_ns - counted_ns) * 1e-9 * self._per_s)
        allowed = tokens >= 1.0
        self._buckets[key] = (tokens - allowed, t_ns)
        if len(self._buckets) > self._most_keys:
            self._buckets.popitem(last=False)
        return allowed
