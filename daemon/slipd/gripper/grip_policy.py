"""State behind the grip rules: the lease, the force in force, slew and budget spent, and the latched fault.

It keeps the books and judges leases alone. Whether a motion may happen is judged by `slipd.gripper.motion_gate`, on the
snapshot that `GripPolicy.state` returns. The end of a lease moves nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from slipd.refusal import Refusal

#: Differences of forces are rounded: 5.1 N over 3.1 N is not quite 2 N. Far below what any gripper resolves.
ROUNDING_N = 1e-9
_MS = 1_000_000
NO_LEASE = Refusal("no_lease", "acquire the lease first: lease.acquire {ttl_ms}; it may have expired")


@dataclass(frozen=True, slots=True)
class GripLimits:
    """Limits of requested forces, all on one pad.

    Attributes:
        min_n: Least force that may be requested, N.
        max_n: Largest, N; None: nothing may be requested.
        step_n: Largest change of the force of a held object by one request, N.
        raise_n_per_s: How fast requests may raise it, N/s.
        lower_n_per_s: How fast requests may lower it, N/s.
        budget_n: Most that all raises of one grasp may add up to, by requests and by the reflex, N.
    """

    min_n: float
    max_n: float | None
    step_n: float
    raise_n_per_s: float
    lower_n_per_s: float
    budget_n: float


@dataclass(frozen=True, slots=True)
class GripState:
    """Snapshot of a `GripPolicy`; every force is the normal force on one pad, N.

    Attributes:
        holder: Client that holds the lease; None: nobody does.
        fault: The latched fault; "" where there is none.
        force_n: The force in force; None where nothing is gripped, or where that force is not known.
        unknown: Something is held by a grip whose force is not known.
        letting_go: The gripper was sent to let go, and has not been seen to: ``force_n`` may still press.
        asked_n: The force a client asked for last; None where nothing is gripped.
        raise_left_n: How far requests may raise the force now.
        lower_left_n: How far requests may lower it now.
        budget_left_n: What is left of the raises of this grasp.
    """

    holder: bytes | None
    fault: str
    force_n: float | None
    unknown: bool
    releasing: bool
    requested_n: float | None
    raise_left_n: float
    lower_left_n: float
    budget_left_n: float

    @property
    def grips(self) -> bool:
        """A grip is in force, whether or not its force is known."""
        return self.unknown or self.force_n is not None


class GripPolicy:
    """The lease, the limits, and what is in force.

    Time is an argument; an earlier one than the latest counts as the latest, so that a late loop revives nothing.

    Args:
        limits: Limits of the forces.
        max_lease_ms: Longest life of a lease without renewal.

    Attributes:
        limits: As given.
    """

    def __init__(self, limits: GripLimits, max_lease_ms: int) -> None:
        self.limits = limits
        self._max_lease_ms = max_lease_ms
        self._now_ns = 0
        self._holder: bytes | None = None
        self._ttl_ns = 0
        self._expires_ns = 0
        self._lapsed = False
        self._raising = _Allowance(limits.raise_n_per_s, limits.step_n)
        self._lowering = _Allowance(limits.lower_n_per_s, limits.step_n)
        self._force_n: float | None = None
        self._unknown = self._letting_go = False
        self._asked_n: float | None = None
        self._raised_n = 0.0
        self._fault = ""

    # The lease

    def holder(self, t_ns: int) -> bytes | None:
        """Client that holds the lease at ``t_ns``; a lease that was once seen to have run out stays so."""
        now_ns = self._now(t_ns)
        if self._holder is not None and now_ns >= self._expires_ns:
            self.end_lease()
        return self._holder

    def expires_in_s(self, t_ns: int) -> float | None:
        """Rest of the lease, s; None where nobody holds it."""
        return None if self.holder(t_ns) is None else (self._expires_ns - self._now_ns) * 1e-9

    def acquire(self, client: bytes, ttl_ms: int, t_ns: int) -> Refusal | None:
        """Gives the lease to a client; one that holds it may ask again."""
        if not 0 < ttl_ms <= self._max_lease_ms:
            return Refusal("out_of_range", f"ttl_ms must be 1 to {self._max_lease_ms}, not {ttl_ms}", "ttl_ms")
        if self.holder(t_ns) not in (None, client):
            rest = (self._expires_ns - self._now_ns) // _MS
            return Refusal("lease_held", f"another client holds the lease, for {rest} ms unless it renews")
        self._holder, self._ttl_ns = client, ttl_ms * _MS
        self._expires_ns = self._now_ns + self._ttl_ns
        return None

    def renew(self, client: bytes, t_ns: int) -> Refusal | None:
        """Starts the life of a lease anew."""
        refusal = self.check_lease(client, t_ns)
        if refusal is None:
            self._expires_ns = self._now_ns + self._ttl_ns
        return refusal

    def release(self, client: bytes, t_ns: int) -> Refusal | None:
        """Ends the lease; moves nothing."""
        refusal = self.check_lease(client, t_ns)
        if refusal is None:
            self._holder = None
        return refusal

    def end_lease(self) -> None:
        """Takes the lease away from whoever holds it, as if it had run out."""
        self._lapsed = self._lapsed or self._holder is not None
        self._holder = None

    def lapsed(self, t_ns: int) -> bool:
        """True once after a lease ended that was not given back; to be asked before the next request is judged."""
        self.holder(t_ns)
        lapsed, self._lapsed = self._lapsed, False
        return lapsed

    def check_lease(self, client: bytes, t_ns: int) -> Refusal | None:
        """Refuses a client that does not hold the lease."""
        if self.holder(t_ns) == client:
            return None
        return NO_LEASE

    def _now(self, t_ns: int) -> int:
        self._now_ns = max(self._now_ns, t_ns)
        return self._now_ns

    # Forces

    def state(self, t_ns: int) -> GripState:
        """Return the snapshot for the motion gate at ``t_ns``."""
        now_ns = self._now(t_ns)
        return GripState(
            self.holder(t_ns),
            self._fault,
            self._force_n,
            self._unknown,
            self._letting_go,
            self._asked_n,
            self._raising.left_n(now_ns),
            self._lowering.left_n(now_ns),
            self._budget_left_n(),
        )

    @property
    def force_n(self) -> float | None:
        """Force that the gripper was sent last, or had when it was found holding, N; None: none, or not known."""
        return None if self._letting_go else self._force_n

    @property
    def unknown(self) -> bool:
        """Something is held by a grip whose force is not known."""
        return self._unknown and not self._letting_go

    @property
    def releasing(self) -> bool:
        """The gripper was sent to let go, and has not been seen to."""
        return self._letting_go

    @property
    def grips(self) -> bool:
        """A grip is in force, whether or not its force is known."""
        return self.unknown or self.force_n is not None

    @property
    def requested_n(self) -> float | None:
        """Force that a client asked for last, N: below it the reflex does not lower; None where it grips nothing."""
        return self._asked_n

    @property
    def most_n(self) -> float | None:
        """Largest force that limits and budget leave to this grasp, N; None where nothing is gripped or may be."""
        if self.limits.max_n is None or self.force_n is None:
            return None
        return min(self.limits.max_n, self.force_n + self._budget_left_n())

    def record_force(self, force_n: float, t_ns: int, *, reflex: bool = False) -> None:
        """Notes the force that the gripper was told; spends slew and budget.

        Raises:
            ValueError: The force is not finite.
        """
        if not math.isfinite(force_n):
            raise ValueError(f"the gripper was told a force that is not finite: {force_n}")
        now_ns = self._now(t_ns)
        if self._force_n is None:
            self._raised_n = 0.0
        else:
            change_n = force_n - self._force_n
            self._raised_n += max(change_n, 0.0)
            (self._raising if change_n > 0.0 else self._lowering).spend(abs(change_n), now_ns)
        self._force_n, self._unknown, self._letting_go = force_n, False, False
        if not reflex:
            self._asked_n = force_n

    def adopt(self, force_n: float | None) -> None:
        """Adopt a grip that no command began as the one in force; None: its force is not known.

        It is a grasp of its own: nothing of its budget is spent, and the reflex does not lower it.
        """
        self._force_n = self._asked_n = force_n
        self._unknown, self._letting_go = force_n is None, False
        self._raised_n = 0.0

    def restore(self, force_n: float | None, *, unknown: bool = False) -> None:
        """What was noted last never reached the gripper: this is in force. What it spent stays spent."""
        self._force_n, self._unknown, self._letting_go = force_n, unknown, False
        self._asked_n = force_n if force_n is None or self._asked_n is None else min(self._asked_n, force_n)

    def begin_release(self, force_n: float | None = None) -> None:
        """Note that the gripper was sent to let go, with ``force_n`` if it was sent a force.

        Nothing is gripped any more for whoever asks, but a new grip that comes before the old one is seen to have ended
        is a change of its force: it must not be a way around step, slew and budget.
        """
        self._letting_go = self._letting_go or self.grips
        if force_n is not None and self._letting_go:
            self._force_n, self._unknown = force_n, False

    def end_grasp(self) -> None:
        """The grasp ended: the gripper opened, lost its object or is not active; the next has a budget of its own."""
        self._force_n = self._asked_n = None
        self._unknown = self._letting_go = False

    def _budget_left_n(self) -> float:
        return max(self.limits.budget_n - self._raised_n, 0.0)

    # Faults

    @property
    def fault(self) -> str:
        """The first fault since the last acknowledgement; "" where there was none."""
        return self._fault

    def latch(self, fault: str) -> None:
        """Keeps a fault until it is acknowledged, unless one is kept already; "" is none."""
        self._fault = self._fault or fault

    def acknowledge(self) -> None:
        """Forgets the fault; what still is wrong will be latched anew."""
        self._fault = ""


class _Allowance:
    """Newtons by which a force may change now: they grow with time, which never runs backwards, up to one step."""

    def __init__(self, rate_n_per_s: float, most_n: float) -> None:
        self._rate_n_per_s = rate_n_per_s
        self._most_n = self._left_n = most_n
        self._t_ns = 0

    def left_n(self, t_ns: int) -> float:
        """What may be spent at ``t_ns``, N."""
        self._left_n = min(self._left_n + self._rate_n_per_s * (t_ns - self._t_ns) * 1e-9, self._most_n)
        self._t_ns = t_ns
        return self._left_n

    def spend(self, amount_n: float, t_ns: int) -> None:
        """Take it away; more than there is (by the reflex) leaves none, and no debt."""
        self._left_n = max(self.left_n(t_ns) - amount_n, 0.0)
