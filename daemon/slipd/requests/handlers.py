"""Answer requests: check each, carry it out at most once, and reply."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from slipd.events import Body, RecordingChanged, Reply, Request
from slipd.publish import replies
from slipd.requests.finger_handlers import FingerHandlers, require_lease
from slipd.requests.idempotency import IdempotencyCache
from slipd.requests.motion_handlers import Handler, check_motion, grip_handlers
from slipd.requests.recording_state import RecordingState
from slipd.requests.request_check import check_request
from slipd.rig import Rig
from slipd.types.permit import Refusal, RefusalError
from slipd_client.messages.ops import OPS, URGENT_OPS

_FREED_BY = {
    "friction.set": "friction_without_lease",
    "object.set": "friction_without_lease",
    "gravity.set": "gravity_without_lease",
}
"""Key of ``[requests]`` that frees an op from the lease, although the reflex acts on what it states."""


class RequestHandlers:
    """Check requests and carry them out, each at most once.

    Args:
        rig: The rig of this run.
        recordings: The recordings on request.
        status: Returns the state of the daemon at a time, as in the ``status`` message.
    """

    def __init__(self, rig: Rig, recordings: RecordingState, status: Callable[[int], Body]) -> None:
        self._boot, self._policy, self._recordings = rig.boot, rig.gripper.policy, recordings
        self._fingers, self._status = rig.fingers, status
        free = {name for name, key in _FREED_BY.items() if getattr(rig.config.requests, key)}
        # a reflex acts on what some requests state
        self._steering = {name: op.steers for name, op in OPS.items() if rig.reflex is not None and name not in free}
        advice = None if rig.grasp is None else rig.grasp.advice
        self._kept = IdempotencyCache()
        self._ops: dict[str, Handler] = {
            # methods: a lambda of a copied engine would answer with the parts of the first one
            "hello": self._hello,
            "status": self._status_now,
            "record.stop": self._stop_recording,
            "motion.check": partial(check_motion, advice, rig.gripper),
            **FingerHandlers(rig).ops,
            **grip_handlers(rig.gripper),
        }

    def answer(self, request: Request, t_ns: int) -> Reply | None:
        """Check a request at ``t_ns`` and carry it out unless a rule forbids it.

        Returns:
            The reply; None where it must wait for the disk (`note_recording`), also for a copy sent meanwhile.
        """
        client, body = request.client, request.body
        try:
            check_request(body, self._boot, t_ns)
            urgent = body["op"] in URGENT_OPS and self._policy.lease.holder(t_ns) == client
            reply = self._kept.seen(client, body, t_ns, urgent=urgent)
        except RefusalError as error:
            return Reply(client, replies.refused(body.get("id"), error.refusal, t_ns))
        if reply is None:
            reply = self._carry_out(request, t_ns)
            self._kept.keep(client, body, reply, t_ns)
        return Reply(client, reply) if reply else None

    def _carry_out(self, request: Request, t_ns: int) -> Body:
        """Carry out a new request and return its reply; an empty reply is completed by `note_recording`."""
        op, number = request.body["op"], request.body["id"]
        try:
            self._check_steering(request, t_ns)
            if op == "record.start":
                return self._recordings.start(request, t_ns)
            return replies.granted(number, self._ops[op](request, t_ns), t_ns)
        except RefusalError as error:
            return replies.refused(number, error.refusal, t_ns)

    def _hello(self, _: Request, t_ns: int) -> Body:
        return replies.hello(self._boot, t_ns, self._fingers)

    def _status_now(self, _: Request, t_ns: int) -> Body:
        return self._status(t_ns)

    def _stop_recording(self, *_: object) -> Body:
        return replies.recording_file(self._recordings.stop())

    def _check_steering(self, request: Request, t_ns: int) -> None:
        """Refuse what the reflex would act on to a client that may not move the gripper."""
        op = request.body["op"]
        rule = self._steering.get(op, "never")
        held = self._policy.grips or self._policy.releasing
        if rule == "never" or (rule == "in_grasp" and not held):
            return
        why = f"the reflex acts on {op}, so that it may move the gripper"
        free = f"; {_FREED_BY[op]} = true in [requests] of the config frees it" if op in _FREED_BY else ""
        require_lease(self._policy.lease, request, t_ns, why, free)

    def note_recording(self, event: RecordingChanged, t_ns: int) -> Reply | None:
        """Note the new state of a recording, and answer the request that waited for it."""
        waiting = self._recordings.note(event)
        if waiting is None:
            return None
        request, reply = waiting
        number = request.body["id"]
        # in place, so that a copy of the request gets the same reply
        if event.state == "running":
            reply |= replies.granted(number, replies.recording_file(event), t_ns)
        else:
            code = "no_room" if event.state == "limited" else "record_failed"
            reply |= replies.refused(number, Refusal(code, event.reason), t_ns)
        return Reply(request.client, reply)
