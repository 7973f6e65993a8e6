"""Answer requests: check each, carry it out at most once, and reply; the state of the recordings on request."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from slipd.events import Body, Record, RecordingChanged, Reply, Request, WallClock
from slipd.publish import replies
from slipd.requests.finger_handlers import FingerHandlers, require_lease
from slipd.requests.motion_handlers import Handler, check_motion, grip_handlers
from slipd.requests.request_check import check_request
from slipd.rig import Rig
from slipd.types.permit import Refusal, RefusalError
from slipd_client.messages import encode
from slipd_client.messages.ops import OPEN_OPS, OPS, URGENT_OPS

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
        self._replies = IdempotencyCache()
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
            reply = self._replies.seen(client, body, t_ns, urgent=urgent)
        except RefusalError as error:
            return Reply(client, replies.refused(body.get("id"), error.refusal, t_ns))
        if reply is None:
            reply = self._carry_out(request, t_ns)
            self._replies.keep(client, body, reply)
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


class RecordingState:
    """Recordings of one run: one on request at a time, and one of the whole run where there is one.

    The service writes the files. The daemon names them, as a name from a client could be any path.

    Args:
        boot: Id of this run.
        wall: Wall clock of the run.

    Attributes:
        requested: The newest recording on request; its state is "none" before the first.
        whole_run: The recording of the whole run; None if the run is not recorded.
    """

    def __init__(self, boot: str, wall: WallClock) -> None:
        self._boot = boot
        self._wall = wall
        self._count = 0
        self.requested = RecordingChanged("", "", "none")
        self.whole_run: RecordingChanged | None = None
        self._waiting: dict[str, tuple[Request, Body]] = {}
        self._due: list[Record] = []

    def start(self, request: Request, t_ns: int) -> Body:
        """Start a recording; return its reply, which is empty until the disk has answered (`note`).

        Raises:
            RefusalError: One is running.
        """
        if self._running:
            rule = f"{self.requested.name} is being recorded: end it with record.stop"
            raise RefusalError("not_ready", rule)
        self._count += 1
        name = f"slipd-{self._wall.stamp(t_ns)}-{self._boot}-{self._count}.mcap"
        self.requested = RecordingChanged(name, "", "running")
        self._due.append(Record(name))
        reply: Body = {}
        self._waiting[name] = request, reply
        return reply

    def stop(self) -> RecordingChanged:
        """End the recording that runs, and return it.

        Raises:
            RefusalError: None is running.
        """
        recording = self.requested
        if not self._running:
            rule = recording.reason or "nothing is being recorded: begin with record.start"
            raise RefusalError("not_ready", rule)
        self.requested = replace(recording, state="stopped")
        self._due.append(Record(""))
        return self.requested

    def note(self, event: RecordingChanged) -> tuple[Request, Body] | None:
        """Note the new state of a recording; return the request that waited for it, if one did, and its empty reply."""
        if not event.name:
            self.whole_run = event
            return None
        if event.name == self.requested.name:
            if self._running or event.state == "failed":
                self.requested = event
            elif event.state == "running":  # its file was created only after its record.stop
                self.requested = replace(event, state="stopped")
        return self._waiting.pop(event.name, None)

    def due(self) -> list[Record]:
        """Return the recordings to start or end since the last call."""
        due, self._due = self._due, []
        return due

    @property
    def _running(self) -> bool:
        return self.requested.state == "running"


PER_CLIENT = 64
"""Requests of one client that are kept at once: 50 per second with the longest deadline are 25, plus a burst."""

MOST_CLIENTS = 1024
"""Clients that are kept at once: several times as many as can be connected, as some reconnect. Beyond this number new
clients are refused, and never one of those kept."""


class IdempotencyCache:
    """Keep every reply until the deadline of its request, as the request may be sent again until then.

    Requests are checked: they have ``id``, ``op`` and, except `OPEN_OPS`, a ``deadline_ns`` in the future. A time
    before the last one counts as the last one, so that no request that was dropped can be carried out again.
    """

    def __init__(self) -> None:
        self._now_ns = 0
        self._clients: dict[bytes, dict[str | int, tuple[bytes, Body]]] = {}  # request, reply
        self._contents: set[bytes] = set()
        self._deadlines: list[tuple[int, int, bytes, str | int]] = []
        self._numbers = itertools.count()

    def seen(self, client: bytes, body: Body, t_ns: int, *, urgent: bool = False) -> Body | None:
        """Return the reply kept for a request; None for a new one, which must be kept (`keep`).

        Args:
            client: The client.
            body: The request.
            t_ns: Now, CLOCK_MONOTONIC.
            urgent: The request is never refused as "busy".

        Raises:
            RefusalError: It is late, a copy of another client's, or one too many.
        """
        if body["op"] in OPEN_OPS:
            return None
        self._forget(t_ns)
        if body["deadline_ns"] <= self._now_ns:
            raise RefusalError("deadline_passed", "the deadline has passed", "deadline_ns")
        content = _content(body)
        mine = self._clients.get(client, {})
        if body["id"] in mine:
            kept, reply = mine[body["id"]]
            if kept == content:
                return reply
            rule = "id must be new for every request: this one was used for another request"
            raise RefusalError("repeated_id", rule, "id")
        if content in self._contents:
            raise RefusalError("replayed", "another client has already sent this request")
        if not urgent and (len(mine) >= PER_CLIENT or (not mine and len(self._clients) >= MOST_CLIENTS)):
            rule = "too many requests whose deadlines have not passed: wait, or use shorter deadlines"
            raise RefusalError("busy", rule)
        return None

    def keep(self, client: bytes, body: Body, reply: Body) -> None:
        """Keep the reply to a new request."""
        if body["op"] in OPEN_OPS:
            return
        content = _content(body)
        self._clients.setdefault(client, {})[body["id"]] = content, reply
        self._contents.add(content)
        heapq.heappush(self._deadlines, (body["deadline_ns"], next(self._numbers), client, body["id"]))

    def _forget(self, t_ns: int) -> None:
        """Drop requests whose deadline has passed."""
        self._now_ns = max(self._now_ns, t_ns)
        while self._deadlines and self._deadlines[0][0] <= self._now_ns:
            _, _, client, name = heapq.heappop(self._deadlines)
            mine = self._clients[client]
            self._contents.remove(mine.pop(name)[0])
            if not mine:
                del self._clients[client]


def _content(body: Body) -> bytes:
    """Return the request packed by msgpack, where 1, 1.0 and true differ; the order of its fields does not count."""
    return encode(dict(sorted(body.items())))
