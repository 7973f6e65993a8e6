"""The gripper of a rig that has none: it moves nothing and reports nothing."""

from __future__ import annotations

from collections.abc import Callable

from slipd.grasp.stored_state import StoredGrip
from slipd.gripper.grip_policy import GripLimits, GripPolicy
from slipd.types.samples import GripperSample
from slipd_client.messages import Health

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

    def update(self, sample: GripperSample) -> None:
        """Do nothing."""

    def lose(self) -> None:
        """Do nothing."""

    def restore(self, grip: StoredGrip, confirmed: Callable[[], None]) -> None:
        """Do nothing."""

    def kept(self) -> StoredGrip | None:
        """Return no grip."""
        return None

    def conditions(self) -> list[tuple[Health, str]]:
        """Return nothing."""
        return []
