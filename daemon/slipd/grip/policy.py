"""Who may ask for a grip force, and which: limits, slew, budget, one lease holder, and the fault that is latched.

What may not be is refused, never clamped, and never done later by itself: a set-point that goes on moving after its
client died is what this avoids. A limit that is not configured means no actuation. The end of a lease moves nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Differences of forces are rounded: 5.1 N over 3.1 N is not quite 2 N. Far below what any gripper resolves.
ROUNDING_N = 1e-9
_MS = 1_000_000


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


class GripPolicy:
    """The lease, the limits, and what is in force.

    Time is an argument; an earlier one than the latest counts as the latest, so that a late loop revives nothing.

    Args:
        limits: Limits of the forces.
        max_lease_ms: Longest life of a lease without renewal.
    """

    def __init__(self, limits: GripLimits, max_lease_ms: int) -> None:
        self._limits = limits
        self._max_lease_ms = max_lease_ms
        self._now_ns = 0
        self._holder: bytes | None = None
        self._ttl_ns = 0
        self._expires_ns = 0
        self._lapsed = False
        self._raising = _Allowance(limits.raise_n_per_s, limits.step_n)
        self._lowering = _Allowance(limits.lower_n_per_s, limits.step_n)
        self._force_n: float | None = None
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
        return Refusal("no_lease", "acquire the lease first: lease.acquire {ttl_ms}; it may have expired")

    def _now(self, t_ns: int) -> int:
        self._now_ns = max(self._now_ns, t_ns)
        return self._now_ns

    # Forces

    @property
    def force_n(self) -> float | None:
        """Force that the gripper was told last, N; None where it grips nothing."""
        return self._force_n

    @property
    def asked_n(self) -> float | None:
        """Force that a client asked for last, N: below it the reflex does not lower; None where it grips nothing."""
        return self._asked_n

    @property
    def most_n(self) -> float | None:
        """Largest force that limits and budget leave to this grasp, N; None where nothing is gripped or may be."""
        if self._limits.max_n is None or self._force_n is None:
            return None
        return min(self._limits.max_n, self._force_n + self._budget_left_n())

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

    def check_change(self, force_n: float, t_ns: int) -> Refusal | None:
        """Refuses a client's change of the force of a held object: limits, step, budget, slew.

        The first force of a grasp meets the limits alone.
        """
        refusal = self.check_force(force_n)
        if refusal is not None or self._force_n is None:
            return refusal
        change_n = force_n - self._force_n
        if abs(change_n) > self._limits.step_n + ROUNDING_N:
            allowed = f"by at most {self._limits.step_n:g} N from the {self._force_n:g} N in force"
            return Refusal("out_of_range", f"force_n may change {allowed}, not to {force_n:g}", "force_n")
        allowance = self._raising if change_n > 0.0 else self._lowering
        wait_ms = allowance.wait_ms(abs(change_n), self._now(t_ns))
        too_fast = f"force_n {force_n:g} N may be asked for again in {wait_ms} ms: at most {allowance.rate:g} N/s"
        return self._check_budget(change_n) or (Refusal("too_fast", too_fast, "force_n") if wait_ms else None)

    def check_reflex(self, force_n: float) -> Refusal | None:
        """Refuses a force of the reflex: a latched fault, limits, nothing gripped, below what was asked, budget."""
        refusal = self.check_fault() or self.check_force(force_n)
        if refusal is not None:
            return refusal
        if self._force_n is None or self._asked_n is None:
            return Refusal("not_ready", "nothing is gripped")
        if force_n < min(self._asked_n, self._force_n) - ROUNDING_N:
            return Refusal("out_of_range", f"the reflex does not lower below the {self._asked_n:g} N asked for")
        return self._check_budget(force_n - self._force_n)

    def grip(self, force_n: float, t_ns: int, *, reflex: bool = False) -> None:
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
        self._force_n = force_n
        if not reflex:
            self._asked_n = force_n

    def put_back(self, force_n: float | None) -> None:
        """What was noted last never reached the gripper: this is in force. What it spent stays spent."""
        self._force_n = force_n
        self._asked_n = force_n if force_n is None or self._asked_n is None else min(self._asked_n, force_n)

    def let_go(self) -> None:
        """The grasp ended: the gripper opened, lost its object or is not active; the next has a budget of its own."""
        self._force_n = self._asked_n = None

    def _budget_left_n(self) -> float:
        return max(self._limits.budget_n - self._raised_n, 0.0)

    def _check_budget(self, change_n: float) -> Refusal | None:
        left_n = self._budget_left_n()
        if change_n <= 0.0 or change_n <= left_n + ROUNDING_N:
            return None
        budget = f"of the {self._limits.budget_n:g} N by which one grasp may be raised {left_n:g} N are left"
        return Refusal("budget_spent", f"{budget}, not {change_n:g}", "force_n")

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

    def check_fault(self) -> Refusal | None:
        """Refuses to move while a fault is latched."""
        if not self._fault:
            return None
        return Refusal("fault_latched", f"{self._fault}; when that is put right, request fault.ack")


class _Allowance:
    """Newtons by which a force may change now: they grow with time, which never runs backwards, up to one step."""

    def __init__(self, rate_n_per_s: float, most_n: float) -> None:
        self.rate = rate_n_per_s
        self._most_n = self._left_n = most_n
        self._t_ns = 0

    def wait_ms(self, amount_n: float, t_ns: int) -> int:
        """Whole milliseconds until ``amount_n`` (at most a step) is allowed; 0: it is."""
        self._grow(t_ns)
        missing_n = min(amount_n, self._most_n) - self._left_n
        return 0 if missing_n <= ROUNDING_N else math.ceil(missing_n / self.rate * 1e3)

    def spend(self, amount_n: float, t_ns: int) -> None:
        """Takes it away; more than there is (by the reflex) leaves none, and no debt."""
        self._grow(t_ns)
        self._left_n = max(self._left_n - amount_n, 0.0)

    def _grow(self, t_ns: int) -> None:
        self._left_n = min(self._left_n + self.rate * (t_ns - self._t_ns) * 1e-9, self._most_n)
        self._t_ns = t_ns
