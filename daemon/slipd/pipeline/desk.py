"""Answers requests: each op is a method that returns its result, or why it is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from slipd.grip.once import OnceOnly
from slipd.grip.policy import Refusal
from slipd.pipeline.events import Reply, Request
from slipd.pipeline.finger import Finger
from slipd.pipeline.grip_desk import GripDesk, Handler, without_gripper
from slipd.pipeline.gripper import GripperControl, Result
from slipd.pipeline.recordings import Recordings
from slipd.pipeline.requests import OPS, check_request
from slipd.signals.gravity import gravity_fault
from slipd_client.messages import PROTOCOL_VERSION

DEFAULT_TARE_S = 0.5
#: A longer average waits for drift, not for noise.
LONGEST_TARE_S = 10.0
#: Rubber on rough glass reaches 2 to 3; beyond this somebody mistook a unit.
MOST_MU = 10.0


class Desk:
    """Judges requests and carries them out, each at most once.

    Args:
        boot: Id of this run.
        fingers: The fingers by name.
        gripper: The gripper; None where the config names none.
        recordings: The recordings on request.
        status: Makes the body of the ``status`` message for an instant.
    """

    def __init__(
        self,
        boot: str,
        fingers: dict[str, Finger],
        gripper: GripperControl | None,
        recordings: Recordings,
        status: Callable[[int], dict[str, Any]],
    ) -> None:
        self._boot = boot
        self._fingers = fingers
        self._recordings = recordings
        self._once = OnceOnly()
        self._status = status
        self._ops: dict[str, Handler] = {
            "hello": self._hello,
            "status": self._status_now,
            "tare": self._tare,
            "tare.get": self._tare_get,
            "tare.undo": self._tare_undo,
            "gravity.set": self._gravity_set,
            "friction.set": self._friction_set,
            "record.start": self._record_start,
            "record.stop": self._record_stop,
        }
        grip_ops = {} if gripper is None else GripDesk(fingers, gripper).ops
        self._ops = dict.fromkeys(OPS, without_gripper) | self._ops | grip_ops

    def answer(self, request: Request, t_ns: int) -> Reply:
        """Judges a request at ``t_ns`` and carries it out where nothing speaks against it."""
        body = request.body
        refusal = check_request(body, self._boot, t_ns)
        if refusal is not None:
            return _reply(request, refusal, t_ns)
        seen = self._once.seen(request.client, body, t_ns)
        if seen is None:
            reply = _reply(request, self._ops[body["op"]](request, t_ns), t_ns)
            self._once.keep(request.client, body, reply.body, t_ns)
            return reply
        return _reply(request, seen, t_ns) if isinstance(seen, Refusal) else Reply(request.client, seen)

    def _hello(self, _: Request, t_ns: int) -> Result:
        return {"boot": self._boot, "t_ns": t_ns, "version": PROTOCOL_VERSION, "fingers": list(self._fingers)}

    def _status_now(self, _: Request, t_ns: int) -> Result:
        return self._status(t_ns)

    def _finger(self, request: Request) -> Finger | Refusal:
        name = request.body["finger"]
        finger = self._fingers.get(name)
        if finger is None:
            known = ", ".join(self._fingers)
            return Refusal("unknown_finger", f"there is no finger {name!r:.40}; known: {known}", "finger")
        return finger

    def _tare(self, request: Request, t_ns: int) -> Result:
        finger = self._finger(request)
        if isinstance(finger, Refusal):
            return finger
        seconds = request.body.get("seconds", DEFAULT_TARE_S)
        if not 0.0 < seconds <= LONGEST_TARE_S:
            return Refusal("out_of_range", f"seconds must be above 0 and at most {LONGEST_TARE_S:g}", "seconds")
        if finger.state.verdict.reasons == ("stale",):
            return Refusal("not_ready", f"finger {finger.name} has no fresh readings to average", "finger")
        if finger.pressed() is True:
            return Refusal("in_contact", f"finger {finger.name} is in contact: a tare would erase its load", "finger")
        verified = finger.pressed() is False
        finger.begin_tare(t_ns, seconds, _named(request.client))
        in_force = finger.tare.current.id
        return {"finger": finger.name, "seconds": seconds, "verified": verified, "tare_id": in_force}

    def _tare_get(self, request: Request, _: int) -> Result:
        finger = self._finger(request)
        if isinstance(finger, Refusal):
            return finger
        offset = finger.tare.current
        return {
            "finger": finger.name,
            "tare_id": offset.id,
            "taken_t_ns": offset.t_ns,
            "readings": offset.readings,
            "offset": offset.value.ravel().tolist(),
            "by": offset.by,
            "gravity_mps2": None if offset.gravity_mps2 is None else offset.gravity_mps2.tolist(),
            "std": None if offset.std is None else offset.std.ravel().tolist(),
            "busy": finger.tare.busy,
            "given_up": finger.tare.aborted_reason or None,
        }

    def _tare_undo(self, request: Request, t_ns: int) -> Result:
        finger = self._finger(request)
        if isinstance(finger, Refusal):
            return finger
        if not finger.undo_tare():
            return Refusal("not_ready", f"finger {finger.name} has no earlier tare to go back to", "finger")
        return self._tare_get(request, t_ns)

    def _gravity_set(self, request: Request, t_ns: int) -> Result:
        finger = self._finger(request)
        if isinstance(finger, Refusal):
            return finger
        if finger.force is None:
            return Refusal("not_ready", f"finger {finger.name} has no force sensor that weighs it", "finger")
        fault = gravity_fault(request.body["gravity_mps2"])
        if fault is not None:
            return Refusal("out_of_range", fault, "gravity_mps2")
        finger.force.set_gravity(request.body["gravity_mps2"], t_ns)
        return {"gravity": finger.force.gravity.state(t_ns)}

    def _friction_set(self, request: Request, _: int) -> Result:
        finger = self._finger(request)
        if isinstance(finger, Refusal):
            return finger
        body = request.body
        mu_s = float(body["mu_s"])
        mu_d = float(body.get("mu_d", mu_s))
        if not 0.0 < mu_s <= MOST_MU:
            return Refusal("out_of_range", f"mu_s must be above 0 and at most {MOST_MU:g}, not {mu_s:g}", "mu_s")
        if not 0.0 < mu_d <= mu_s:
            return Refusal("out_of_range", f"mu_d must be above 0 and at most mu_s, {mu_s:g}, not {mu_d:g}", "mu_d")
        finger.set_friction(mu_s, mu_d if "mu_d" in body else None)
        return {"finger": finger.name, "mu": finger.mu, "mu_source": finger.mu_source}

    def _record_start(self, _: Request, t_ns: int) -> Result:
        return self._recordings.start(t_ns)

    def _record_stop(self, _: Request, __: int) -> Result:
        return self._recordings.stop()


def _reply(request: Request, found: Result, t_ns: int) -> Reply:
    head = {"v": PROTOCOL_VERSION, "id": request.body.get("id"), "t_ns": t_ns}
    if isinstance(found, Refusal):
        error = {"code": found.code, "message": found.message, "field": found.field}
        return Reply(request.client, head | {"ok": False, "error": error})
    return Reply(request.client, head | {"ok": True, "result": found})


def _named(client: bytes) -> str:
    """Who a client is, for people: its key, or its process as the kernel names it; not the route that it chose."""
    return client.partition(b"\0")[0].decode(errors="replace")
