"""Answer requests: check each, carry it out at most once, and reply."""

from __future__ import annotations

from collections.abc import Callable

from slipd.config import Requests
from slipd.events import RecordingChanged, Reply, Request
from slipd.finger.finger import Finger
from slipd.grasp.named_object import NamedObject
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.no_gripper import NoGripper
from slipd.publish import replies
from slipd.publish.replies import Result
from slipd.publish.wire_values import Body
from slipd.requests.finger_handlers import FingerHandlers, lease_advice
from slipd.requests.gripper_handlers import gripper_handlers
from slipd.requests.idempotency import IdempotencyCache
from slipd.requests.lease_handlers import LeaseHandlers
from slipd.requests.object_handlers import ObjectHandlers
from slipd.requests.recording_state import RecordingState
from slipd.requests.request_check import check_request
from slipd.types.refusal import Refusal
from slipd_client.messages.schema.ops import OPS, URGENT_OPS

_FREED_BY = {
    "friction.set": "friction_without_lease",
    "object.set": "friction_without_lease",
    "gravity.set": "gravity_without_lease",
}
"""Key of ``[requests]`` with which an op on which the reflex acts needs no lease."""


class RequestHandlers:
    """Check requests and carry them out, each at most once.

    Args:
        boot: Id of this run.
        fingers: The fingers by name.
        named: The object that clients name.
        gripper: The gripper; keeps the lease.
        requests: ``[requests]``.
        reflex: The rig has a reflex, which acts on what some requests state.
        recordings: The recordings on request.
        status: Returns the state of the daemon at a time, as in the ``status`` message.
    """

    def __init__(
        self,
        boot: str,
        fingers: dict[str, Finger],
        named: NamedObject,
        gripper: GripperControl | NoGripper,
        requests: Requests,
        reflex: bool,
        recordings: RecordingState,
        status: Callable[[int], Body],
    ) -> None:
        self._boot = boot
        self._fingers = fingers
        self._policy = policy = gripper.policy
        free = {name for name, key in _FREED_BY.items() if getattr(requests, key)}
        self._steering = {name: op.steers for name, op in OPS.items() if reflex and name not in free}
        self._recordings = recordings
        self._status = status
        self._kept = IdempotencyCache()
        self._pending: dict[tuple[bytes, str | int], Body] = {}
        self._ops: dict[str, Callable[[Request, int], Result | None]] = {
            "hello": self._hello,
            "status": self._status_now,
            "record.start": self._record_start,
            "record.stop": self._record_stop,
            **LeaseHandlers(policy).ops,
            **FingerHandlers(fingers, policy, requests).ops,
            **ObjectHandlers(fingers, named, policy, requests).ops,
            **gripper_handlers(gripper),
        }

    def answer(self, request: Request, t_ns: int) -> Reply | None:
        """Check a request at ``t_ns`` and carry it out unless a rule forbids it.

        Returns:
            The reply; None where it must wait for the disk (`note_recording`), also for a copy sent meanwhile.
        """
        body = request.body
        refusal = check_request(body, self._boot, t_ns)
        if refusal is not None:
            return Reply(request.client, replies.reply_body(body.get("id"), refusal, t_ns))
        urgent = body["op"] in URGENT_OPS and self._policy.lease.holder(t_ns) == request.client
        seen = self._kept.seen(request.client, body, t_ns, urgent=urgent)
        if isinstance(seen, Refusal):
            return Reply(request.client, replies.reply_body(body["id"], seen, t_ns))
        reply = self._carry_out(request, t_ns) if seen is None else seen
        return Reply(request.client, reply) if reply else None

    def _carry_out(self, request: Request, t_ns: int) -> Body:
        """Carry out a new request and keep its reply; an empty reply is completed by `note_recording`."""
        client, number = request.client, request.body["id"]
        result = self._check_steering(request, t_ns) or self._ops[request.body["op"]](request, t_ns)
        reply: Body = {} if result is None else replies.reply_body(number, result, t_ns)
        if result is None:
            self._pending[client, number] = reply
        self._kept.keep(client, request.body, reply, t_ns)
        return reply

    def _check_steering(self, request: Request, t_ns: int) -> Refusal | None:
        """Refuse what the reflex would act on to a client that may not move the gripper."""
        op = request.body["op"]
        rule = self._steering.get(op, "never")
        held = self._policy.grips or self._policy.releasing
        if rule == "never" or (rule == "in_grasp" and not held):
            return None
        refusal = self._policy.lease.check(request.client, t_ns)
        if refusal is None:
            return None
        why = f"the reflex acts on {op}, so that it may move the gripper"
        free = f"; {_FREED_BY[op]} = true in [requests] of the config frees it" if op in _FREED_BY else ""
        return Refusal(refusal.code, f"{why}: {lease_advice(self._policy, t_ns)}{free}")

    def note_recording(self, event: RecordingChanged, t_ns: int) -> Reply | None:
        """Note the new state of a recording, and answer the request that waited for it."""
        settled = self._recordings.settle(event)
        if settled is None:
            return None
        request, outcome = settled
        result = outcome if isinstance(outcome, Refusal) else replies.recording_file(outcome)
        reply = self._pending.pop((request.client, request.body["id"]), {})
        # in place, so that a copy of the request gets the same reply
        reply |= replies.reply_body(request.body["id"], result, t_ns)
        return Reply(request.client, reply)

    def _hello(self, _: Request, t_ns: int) -> Result:
        return replies.hello(self._boot, t_ns, self._fingers)

    def _status_now(self, _: Request, t_ns: int) -> Result:
        return self._status(t_ns)

    def _record_start(self, request: Request, t_ns: int) -> Refusal | None:
        return self._recordings.start(request, t_ns)

    def _record_stop(self, _: Request, __: int) -> Result:
        ended = self._recordings.stop()
        return ended if isinstance(ended, Refusal) else replies.recording_file(ended)
