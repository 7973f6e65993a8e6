"""Who may ask for a grip force, and which: absolute limits and one lease holder.

What is out of range is refused, never clamped, and a limit that is not configured means no actuation. The end of a
lease moves nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a request is not carried out.

    Attributes:
        code: Error code of the message API.
        message: What is wrong and what would be right.
        field: Field of the request; "" where it is none.
    """

    code: str
    message: str
    field: str = ""


@dataclass(frozen=True, slots=True)
class GripLimits:
    """Absolute limits of requested forces, N on one pad; ``max_n`` None: nothing may be requested."""

    min_n: float
    max_n: float | None


class GripPolicy:
    """The lease and the limits. Time is an argument.

    Args:
        limits: Absolute limits.
        max_lease_ms: Longest life of a lease without renewal.
    """

    def __init__(self, limits: GripLimits, max_lease_ms: int) -> None:
        self._limits = limits
        self._max_lease_ms = max_lease_ms
        self._holder: bytes | None = None
        self._ttl_ns = 0
        self._expires_ns = 0

    def holder(self, t_ns: int) -> bytes | None:
        """Client that holds the lease at ``t_ns``."""
        return self._holder if t_ns < self._expires_ns else None

    def expires_in_s(self, t_ns: int) -> float | None:
        """Rest of the lease, s; None where nobody holds it."""
        return None if self.holder(t_ns) is None else (self._expires_ns - t_ns) * 1e-9

    def acquire(self, client: bytes, ttl_ms: int, t_ns: int) -> Refusal | None:
        """Gives the lease to a client; one that holds it may ask again."""
        if not 0 < ttl_ms <= self._max_lease_ms:
            return Refusal("out_of_range", f"ttl_ms must be 1 to {self._max_lease_ms}, not {ttl_ms}", "ttl_ms")
        if self.holder(t_ns) not in (None, client):
            rest = (self._expires_ns - t_ns) // 1_000_000
            return Refusal("lease_held", f"another client holds the lease, for {rest} ms unless it renews")
        self._holder, self._ttl_ns = client, ttl_ms * 1_000_000
        self._expires_ns = t_ns + self._ttl_ns
        return None

    def renew(self, client: bytes, t_ns: int) -> Refusal | None:
        """Starts the life of a lease anew."""
        refusal = self.check_lease(client, t_ns)
        if refusal is None:
            self._expires_ns = t_ns + self._ttl_ns
        return refusal

    def release(self, client: bytes, t_ns: int) -> Refusal | None:
        """Ends the lease; moves nothing."""
        refusal = self.check_lease(client, t_ns)
        if refusal is None:
            self.end_lease()
        return refusal

    def end_lease(self) -> None:
        """Ends whatever lease there is."""
        self._holder, self._expires_ns = None, 0

    def check_lease(self, client: bytes, t_ns: int) -> Refusal | None:
        """Refuses a client that does not hold the lease."""
        if self.holder(t_ns) == client:
            return None
        return Refusal("no_lease", "acquire the lease first: lease.acquire {ttl_ms}; it may have expired")

    def check_force(self, force_n: float) -> Refusal | None:
        """Refuses a force that is not finite or outside the limits, and any where no limit is configured."""
        if self._limits.max_n is None:
            return Refusal("no_limit", "gripper.max_force_n is not configured, so no force may be requested")
        if not math.isfinite(force_n):
            return Refusal("not_finite", f"force_n must be finite, not {force_n}", "force_n")
        if not self._limits.min_n <= force_n <= self._limits.max_n:
            allowed = f"{self._limits.min_n:g} to {self._limits.max_n:g} N"
            return Refusal("out_of_range", f"force_n must be {allowed} on one pad, not {force_n:g}", "force_n")
        return None
