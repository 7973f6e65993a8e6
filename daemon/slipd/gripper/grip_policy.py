"""State behind the grip rules: the lease, the force in force, the slew and budget spent, and the latched fault.

The policy only keeps the state. `slipd.gripper.grip_gate` decides about motions, on the snapshot that
`GripPolicy.state` returns. A rig without a gripper has a policy too, for its lease (`NoGripper`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from slipd.gripper.lease import Lease

ROUNDING_N = 1e-9
"""Tolerance of force comparisons, N: 5.1 N - 3.1 N is not exactly 2 N. Far below the resolution of any gripper."""


@dataclass(frozen=True, slots=True)
class GripLimits:
    """Limits of requested forces, all on one pad.

    Attributes:
        min_n: Least force that may be requested, N.
        max_n: Largest force that may be requested, N; None: no force may be requested.
        step_n: Largest change of the force of a held object at once, N.
        raise_n_per_s: How fast requests and the reflex together may raise it, N/s.
        lower_n_per_s: How fast they may lower it, N/s.
        budget_n: Largest sum of all raises of one grasp by requests, N, and likewise by the reflex.
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
        holder: Client that holds the lease, or None.
        fault: The latched fault, or "".
        force_n: The force in force; None if nothing is gripped or the force is not known.
        unknown: An object is held with a force that is not known.
        releasing: A release was commanded and is not confirmed yet: ``force_n`` may still act.
        requested_n: The force that a client requested last; None if nothing is gripped.
        raise_left_n: Largest raise that is possible now.
        lower_left_n: Largest lowering that is possible now.
        budget_left_n: Rest of the raise budget of requests in this grasp.
        reflex_left_n: Likewise of the reflex.
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
    reflex_left_n: float

    @property
    def grips(self) -> bool:
        """A grip is in force or its release is not confirmed, whether or not its force is known."""
        return self.unknown or self.force_n is not None


class GripPolicy:
    """The lease, the limits, and the grip in force.

    Time is an argument. A time before the latest one counts as the latest, so that a late call revives nothing.

    Args:
        limits: Limits of the forces.
        max_lease_ms: Longest time that a lease lasts without renewal.
        waits: Whether a force waits to be acknowledged; no allowance is regained meanwhile.

    Attributes:
        limits: As given.
        lease: Which client may move the gripper.
        releasing: A release was commanded and is not confirmed yet.
        requested_n: Force that a client requested last, N; the reflex does not lower below it. None if nothing is
            gripped.
        raised_n: Sum of all raises of this grasp by requests, N; ``reflexed_n``: likewise by the reflex.
        fault: First fault since the last acknowledgement, or "".
    """

    def __init__(self, limits: GripLimits, max_lease_ms: int, waits: Callable[[], bool] = lambda: False) -> None:
        self.limits = limits
        self._waits = waits
        self.lease = Lease(max_lease_ms)
        self._raising = _Allowance(limits.raise_n_per_s, limits.step_n)
        self._lowering = _Allowance(limits.lower_n_per_s, limits.step_n)
        self._force_n: float | None = None
        self._unknown = self.releasing = False
        self.requested_n: float | None = None
        self.raised_n = self.reflexed_n = 0.0
        self.fault = ""

    # Forces

    def state(self, t_ns: int) -> GripState:
        """Return the snapshot for the grip gate at ``t_ns``."""
        lower_left_n, raise_left_n = self.change_left_n(t_ns)
        return GripState(
            holder=self.lease.holder(t_ns),
            fault=self.fault,
            force_n=self._force_n,
            unknown=self._unknown,
            releasing=self.releasing,
            requested_n=self.requested_n,
            raise_left_n=raise_left_n,
            lower_left_n=lower_left_n,
            budget_left_n=self._budget_left_n(self.raised_n),
            reflex_left_n=self._budget_left_n(self.reflexed_n),
        )

    @property
    def force_n(self) -> float | None:
        """Force last sent to the gripper, or found in force, N; None: no grip, or not known."""
        return None if self.releasing else self._force_n

    @property
    def unknown(self) -> bool:
        """An object is held with a force that is not known."""
        return self._unknown and not self.releasing

    @property
    def grips(self) -> bool:
        """A grip is in force and not being released, whether or not its force is known."""
        return self.unknown or self.force_n is not None

    @property
    def reflex_most_n(self) -> float | None:
        """Largest force that limits and budget allow the reflex in this grasp, N; None without a grip or a limit."""
        if self.limits.max_n is None or self.force_n is None:
            return None
        return min(self.limits.max_n, self.force_n + self._budget_left_n(self.reflexed_n))

    def change_left_n(self, t_ns: int) -> tuple[float, float]:
        """Return the largest lowering and the largest raise that step and rate leave at ``t_ns``, N."""
        now_ns, grows = self.lease.now(t_ns), not self._waits()
        return self._lowering.left_n(now_ns, grows=grows), self._raising.left_n(now_ns, grows=grows)

    def record_force(self, force_n: float, t_ns: int, *, reflex: bool = False) -> None:
        """Record a force that was sent to the gripper, and spend slew and budget.

        Raises:
            ValueError: The force is not finite.
        """
        if not math.isfinite(force_n):
            raise ValueError(f"force_n must be finite, got {force_n}")
        now_ns = self.lease.now(t_ns)
        if self._force_n is None:
            self.raised_n = self.reflexed_n = 0.0
        else:
            change_n = force_n - self._force_n
            if reflex:
                self.reflexed_n += max(change_n, 0.0)
            else:
                self.raised_n += max(change_n, 0.0)
            (self._raising if change_n > 0.0 else self._lowering).spend(abs(change_n), now_ns)
        self._force_n, self._unknown, self.releasing = force_n, False, False
        if not reflex:
            self.requested_n = force_n

    def adopt(self, force_n: float | None) -> None:
        """Adopt a grip that no command of this run began; ``force_n`` is None if its force is not known.

        It counts as a new grasp: its budget is whole, and the reflex does not lower it.
        """
        self._force_n = self.requested_n = force_n
        self._unknown, self.releasing = force_n is None, False
        self.raised_n = self.reflexed_n = 0.0

    def resume(self, force_n: float, requested_n: float | None, raised_n: float, reflexed_n: float) -> None:
        """Continue a grasp of the run before: its force, what a client requested, and what is spent of both budgets."""
        self.adopt(force_n)
        self.requested_n, self.raised_n, self.reflexed_n = requested_n, raised_n, reflexed_n

    def restore(self, force_n: float | None, *, unknown: bool = False) -> None:
        """Restore the force in force after a command that never reached the gripper; what it spent stays spent."""
        self._force_n, self._unknown, self.releasing = force_n, unknown, False
        self.requested_n = force_n if force_n is None or self.requested_n is None else min(self.requested_n, force_n)

    def begin_release(self, force_n: float | None = None) -> None:
        """Record a release command, sent with ``force_n`` if a force was sent.

        From here on no grip is reported as in force. But a new grip before the release is confirmed still counts as a
        change of the old force, so that it is no way around step, slew and budget.
        """
        self.releasing = self.releasing or self.grips
        if force_n is not None and self.releasing:
            self._force_n, self._unknown = force_n, False

    def end_grasp(self) -> None:
        """Record the end of the grasp: the gripper opened, lost its object or is inactive; its budget ends too."""
        self._force_n = self.requested_n = None
        self._unknown = self.releasing = False

    def _budget_left_n(self, raised_n: float) -> float:
        return max(self.limits.budget_n - raised_n, 0.0)

    # Faults

    def latch(self, fault: str) -> None:
        """Latch a fault until it is acknowledged; one that is latched already stays."""
        self.fault = self.fault or fault

    def acknowledge(self) -> None:
        """Clear the latched fault; a fault that persists is latched again."""
        self.fault = ""


class _Allowance:
    """Allowance of force change, N: it grows at a rate, up to one step. Time never runs backwards."""

    def __init__(self, rate_n_per_s: float, most_n: float) -> None:
        self._rate_n_per_s = rate_n_per_s
        self._most_n = self._left_n = most_n
        self._t_ns = 0

    def left_n(self, t_ns: int, *, grows: bool = True) -> float:
        """Return what may be spent at ``t_ns``, N; without ``grows``, the time since the last call adds nothing."""
        if grows:
            self._left_n = min(self._left_n + self._rate_n_per_s * (t_ns - self._t_ns) * 1e-9, self._most_n)
        self._t_ns = t_ns
        return self._left_n

    def spend(self, amount_n: float, t_ns: int) -> None:
        """Spend an amount; overspending, by the rounding of a gripper, leaves zero and no debt."""
        self._left_n = max(self.left_n(t_ns) - amount_n, 0.0)


LONGEST_LEASE_MS = 200
"""Longest life of a lease without renewal on a rig without gripper; with one, it is ``gripper.max_lease_ms``."""


class NoGripper:
    """Stands in for a `GripperControl`; its lease still decides who may make verdicts more lenient.

    Attributes:
        policy: Keeps the lease; permits no force.
        width_m: Not known.
    """

    width_m: float | None = None

    def __init__(self) -> None:
        self.policy = GripPolicy(GripLimits(0.0, None, 0.0, 0.0, 0.0, 0.0), LONGEST_LEASE_MS)

    @property
    def deadline_ns(self) -> int:
        """When `on_time` may find a change, unless something else comes before."""
        return self.policy.lease.deadline_ns

    def on_time(self, t_ns: int) -> bool:
        """Update with the time; return True if a lease expired."""
        return self.policy.lease.lapsed(t_ns)

    def wake(self) -> None:
        """Handle the end of a suspend: the lease ends."""
        self.policy.lease.end()

    def drop_after_pause(self, pause_ns: int) -> None:
        """Do nothing."""
