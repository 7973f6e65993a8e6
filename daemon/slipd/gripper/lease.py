"""The lease: which client may move the gripper, and until when. Its end moves nothing.

A client that dies stops renewing its lease, which then ends within its own time, at most ``max_lease_ms`` (200 ms
unless the config says otherwise).
"""

from __future__ import annotations

from slipd.events import NEVER_NS
from slipd.types.permit import Refusal

_MS = 1_000_000
NO_LEASE = Refusal(
    "no_lease", "this client does not hold the lease, or its lease has ended: acquire it first (lease.acquire)"
)


class Lease:
    """The lease of at most one client.

    Time is an argument. A time before the latest one counts as the latest, so that a late call revives nothing.

    Args:
        max_ms: Longest time that a lease lasts without renewal.
    """

    def __init__(self, max_ms: int) -> None:
        self._max_ms = max_ms
        self._now_ns = 0
        self._holder: bytes | None = None
        self._ttl_ns = 0
        self._expires_ns = 0
        self._lapsed = False

    def holder(self, t_ns: int) -> bytes | None:
        """Return the client that holds the lease at ``t_ns``, or None; an expired lease stays expired."""
        now_ns = self.now(t_ns)
        if self._holder is not None and now_ns >= self._expires_ns:
            self.end()
        return self._holder

    @property
    def deadline_ns(self) -> int:
        """When `lapsed` may be True: the end of the lease, unless it is renewed, or at once if it ended."""
        if self._lapsed:
            return 0
        return NEVER_NS if self._holder is None else self._expires_ns

    def expires_in_s(self, t_ns: int) -> float | None:
        """Return the remaining time of the lease, s; None if nobody holds it."""
        return None if self.holder(t_ns) is None else (self._expires_ns - self._now_ns) * 1e-9

    def acquire(self, client: bytes, ttl_ms: int, t_ns: int) -> Refusal | None:
        """Give the lease to a client; its holder may acquire it again."""
        if not 0 < ttl_ms <= self._max_ms:
            return Refusal("out_of_range", f"ttl_ms must be from 1 to {self._max_ms}, got {ttl_ms}", "ttl_ms")
        if self.holder(t_ns) not in (None, client):
            rest = (self._expires_ns - self._now_ns) // _MS
            return Refusal("lease_held", f"another client holds the lease for {rest} ms more, unless it renews it")
        self._holder, self._ttl_ns = client, ttl_ms * _MS
        self._expires_ns = self._now_ns + self._ttl_ns
        return None

    def renew(self, client: bytes, t_ns: int) -> Refusal | None:
        """Restart the time of a lease."""
        refusal = self.check(client, t_ns)
        if refusal is None:
            self._expires_ns = self._now_ns + self._ttl_ns
        return refusal

    def release(self, client: bytes, t_ns: int) -> Refusal | None:
        """End the lease; nothing moves."""
        refusal = self.check(client, t_ns)
        if refusal is None:
            self._holder = None
        return refusal

    def end(self) -> None:
        """Revoke the lease, as if it had expired."""
        self._lapsed = self._lapsed or self._holder is not None
        self._holder = None

    def lapsed(self, t_ns: int) -> bool:
        """Return True once after a lease expired or was revoked; call it before the next request is judged."""
        self.holder(t_ns)
        lapsed, self._lapsed = self._lapsed, False
        return lapsed

    def check(self, client: bytes, t_ns: int) -> Refusal | None:
        """Return a refusal unless the client holds the lease."""
        return None if self.holder(t_ns) == client else NO_LEASE

    def now(self, t_ns: int) -> int:
        """Return the latest time of all calls."""
        self._now_ns = max(self._now_ns, t_ns)
        return self._now_ns
