"""Answers requests: each op is a method that returns its result, or why it is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from slipd.grip.policy import Refusal
from slipd.pipeline.events import Reply, Request
from slipd.pipeline.finger import Finger
from slipd.pipeline.gripper import GripperControl, Result
from slipd.pipeline.requests import check_request
from slipd.signals.gravity import gravity_fault
from slipd_client.messages import PROTOCOL_VERSION

Handler = Callable[[Request, int], Result]

DEFAULT_TARE_S = 0.5
#: A longer average waits for drift, not for noise.
LONGEST_TARE_S = 10.0


class Desk:
    """Judges requests and carries them out.

    Args:
        boot: Id of this run.
        fingers: The fingers by name.
        gripper: The gripper; None where the config names none.
        status: Makes the body of the ``status`` message for an instant.
    """

    def __init__(
        self,
        boot: str,
        fingers: dict[str, Finger],
        gripper: GripperControl | None,
        status: Callable[[int], dict[str, Any]],
    ) -> None:
        self._boot = boot
        self._fingers = fingers
        self._gripper = gripper
        self._status = status
        self._ops: dict[str, Handler] = {
            "hello": self._hello,
            "status": self._status_now,
            "tare": self._tare,
            "tare.get": self._tare_get,
            "tare.undo": self._tare_undo,
            "gravity.set": self._gravity_set,
            "lease.acquire": self._lease_acquire,
            "lease.renew": self._lease_renew,
            "lease.release": self._lease_release,
            "grip.set": self._grip_set,
            "gripper.activate": self._activate,
            "gripper.close": self._close,
            "gripper.open": self._open,
            "gripper.stop": self._stop,
        }

    def answer(self, request: Request, t_ns: int) -> Reply:
        """Judges a request at ``t_ns`` and carries it out where nothing speaks against it."""
        body = request.body
        found: Result | None = check_request(body, self._boot, t_ns)
        if found is None:
            found = self._ops[body["op"]](request, t_ns)
        head = {"v": PROTOCOL_VERSION, "id": body.get("id"), "t_ns": t_ns}
        if isinstance(found, Refusal):
            error = {"code": found.code, "message": found.message, "field": found.field}
            return Reply(request.client, head | {"ok": False, "error": error})
        return Reply(request.client, head | {"ok": True, "result": found})

    def _hello(self, _: Request, t_ns: int) -> Result:
        return {"boot": self._boot, "t_ns": t_ns, "version": PROTOCOL_VERSION, "fingers": list(self._fingers)}

    def _status_now(self, _: Request, t_ns: int) -> Result:
        return self._status(t_ns)

    def _finger(self, request: Request) -> Finger | Refusal:
        name = request.body["finger"]
        finger = self._fingers.get(name)
        if finger is None:
            known = ", ".join(self._fingers)
            return Refusal("unknown_finger", f"there is no finger {name!r}; known: {known}", "finger")
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
        finger.begin_tare(t_ns, seconds, request.client.hex())
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

    def _lease_acquire(self, request: Request, t_ns: int) -> Result:
        gripper = self._gripper
        if gripper is None:
            return _NO_GRIPPER
        ttl_ms = request.body["ttl_ms"]
        return gripper.policy.acquire(request.client, ttl_ms, t_ns) or {"ttl_ms": ttl_ms}

    def _lease_renew(self, request: Request, t_ns: int) -> Result:
        gripper = self._gripper
        return _NO_GRIPPER if gripper is None else gripper.policy.renew(request.client, t_ns) or {}

    def _lease_release(self, request: Request, t_ns: int) -> Result:
        gripper = self._gripper
        return _NO_GRIPPER if gripper is None else gripper.policy.release(request.client, t_ns) or {}

    def _grip_set(self, request: Request, t_ns: int) -> Result:
        force_n = float(request.body["force_n"])

        def command(gripper: GripperControl) -> Result:
            return self._blind(force_n, gripper.force_command_n or 0.0) or gripper.set_force(force_n)

        return self._command(request, t_ns, command, force_n)

    def _close(self, request: Request, t_ns: int) -> Result:
        body = request.body
        force_n = float(body["force_n"])

        def command(gripper: GripperControl) -> Result:
            held_n = gripper.force_command_n
            refusal = None if held_n is None else self._blind(force_n, held_n)
            return refusal or gripper.close(force_n, body.get("width_m"), body.get("speed_mps"))

        return self._command(request, t_ns, command, force_n)

    def _blind(self, force_n: float, held_n: float) -> Refusal | None:
        """Refuses to raise a grip that nobody feels."""
        blind = [finger.name for finger in self._fingers.values() if not finger.trusted]
        if not blind or force_n <= held_n:
            return None
        message = f"not to be raised on a stale or doubtful sensor: {', '.join(blind)}; see status"
        return Refusal("not_ready", message, "force_n")

    def _open(self, request: Request, t_ns: int) -> Result:
        body = request.body

        def command(gripper: GripperControl) -> Result:
            touching = [finger.name for finger in self._fingers.values() if finger.pressed() is not False]
            if touching and not body.get("drop", False):
                message = f"not known to be free: {', '.join(touching)}; drop: true opens all the same"
                return Refusal("in_contact", message, "drop")
            return gripper.open(body.get("width_m"), body.get("speed_mps"))

        return self._command(request, t_ns, command)

    def _stop(self, request: Request, t_ns: int) -> Result:
        return self._command(request, t_ns, lambda gripper: gripper.halt())

    def _activate(self, request: Request, t_ns: int) -> Result:
        gripper = self._gripper
        if gripper is None:
            return _NO_GRIPPER
        refusal = gripper.policy.check_lease(request.client, t_ns) or gripper.may_activate()
        return refusal or gripper.activate(t_ns)

    def _command(
        self,
        request: Request,
        t_ns: int,
        command: Callable[[GripperControl], Result],
        force_n: float | None = None,
    ) -> Result:
        """Carries out a command for the holder of the lease, within the limits, on a gripper that can take it."""
        gripper = self._gripper
        if gripper is None:
            return _NO_GRIPPER
        refusal = gripper.policy.check_lease(request.client, t_ns)
        if refusal is None and force_n is not None:
            refusal = gripper.policy.check_force(force_n)
        return refusal or gripper.refuse() or command(gripper)


_NO_GRIPPER = Refusal("no_gripper", "the config has no [gripper]")
