"""Limit the request rate of each client: a number per second in the long term, and one second of them at once."""

from __future__ import annotations

from collections import OrderedDict

MAX_CLIENTS = 1024
"""Clients remembered; the one that was silent for longest is forgotten first, when its bucket is full again."""


class RateLimit:
    """A token bucket for each client.

    Args:
        per_second: Requests per second of one client; it may send as many at once.
    """

    def __init__(self, per_second: float) -> None:
        self._per_s = per_second
        self._most = max(per_second, 1.0)
        self._buckets: OrderedDict[bytes, tuple[float, int]] = OrderedDict()  # tokens, and the time of their count

    def allows(self, client: bytes, t_ns: int) -> bool:
        """Return whether a client may send a request now; if so, count it."""
        tokens, counted_ns = self._buckets.pop(client, (self._most, t_ns))
        tokens = min(self._most, tokens + (t_ns - counted_ns) * 1e-9 * self._per_s)
        allowed = tokens >= 1.0
        self._buckets[client] = (tokens - allowed, t_ns)
        if len(self._buckets) > MAX_CLIENTS:
            self._buckets.popitem(last=False)
        return allowed
