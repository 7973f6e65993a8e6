"""Handlers of the lease requests. Without a gripper the lease still decides who may make verdicts more lenient."""

from __future__ import annotations

from slipd.events import Request
from slipd.gripper.grip_policy import GripPolicy
from slipd.publish import replies
from slipd.publish.replies import Result
from slipd.requests.gripper_handlers import Handler


class LeaseHandlers:
    """Grant the lease to one client at a time.

    Args:
        policy: Keeps the lease.

    Attributes:
        ops: Handler of each op.
    """

    def __init__(self, policy: GripPolicy) -> None:
        self._policy = policy
        self.ops: dict[str, Handler] = {
            "lease.acquire": self._acquire,
            "lease.renew": self._renew,
            "lease.release": self._release,
        }

    def _acquire(self, request: Request, t_ns: int) -> Result:
        ttl_ms = request.body["ttl_ms"]
        return self._policy.lease.acquire(request.client, ttl_ms, t_ns) or replies.lease_granted(ttl_ms)

    def _renew(self, request: Request, t_ns: int) -> Result:
        return self._policy.lease.renew(request.client, t_ns) or replies.done()

    def _release(self, request: Request, t_ns: int) -> Result:
        return self._policy.lease.release(request.client, t_ns) or replies.done()
