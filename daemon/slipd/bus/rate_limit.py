"""How often one client may ask: so many requests a second for long, and a second's worth at once."""

from __future__ import annotations

from collections import OrderedDict

MAX_CLIENTS = 1024
"""Clients remembered; whoever was silent for longest is forgotten first, and had a full bucket again by then."""


class RateLimit:
    """A token bucket for each client.

    Args:
        per_second: Requests that one client may send a second; as many at once.
    """

    def __init__(self, per_second: float) -> None:
        self._per_s = per_second
        self._most = max(per_second, 1.0)
        self._buckets: OrderedDict[bytes, tuple[float, int]] = OrderedDict()  # tokens, and when they were counted

    def allows(self, client: bytes, t_ns: int) -> bool:
        """Whether this client may ask now; counts it where it may."""
        tokens, counted_ns = self._buckets.pop(client, (self._most, t_ns))
        tokens = min(self._most, tokens + (t_ns - counted_ns) * 1e-9 * self._per_s)
        allowed = tokens >= 1.0
        self._buckets[client] = (tokens - allowed, t_ns)
        if len(self._buckets) > MAX_CLIENTS:
            self._buckets.popitem(last=False)
        return allowed
