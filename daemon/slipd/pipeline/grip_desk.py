"""Answers the requests that are about the gripper: who may move it, and every rule that stands before a command."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from slipd.grip.policy import Refusal
from slipd.pipeline.events import Request
from slipd.pipeline.finger import Finger
from slipd.pipeline.gripper import GripperControl, Result

Handler = Callable[[Request, int], Result]

_NO_GRIPPER = Refusal("no_gripper", "the config has no [gripper]")
_NOTHING_GRIPPED = Refusal("not_ready", "no grip is in force: gripper.close begins one")


class GripDesk:
    """Judges requests about the gripper and carries them out.

    Args:
        fingers: The fingers by name.
        gripper: The gripper.

    Attributes:
        ops: What answers each op.
    """

    def __init__(self, fingers: Mapping[str, Finger], gripper: GripperControl) -> None:
        self._fingers = fingers
        self._gripper = gripper
        self._policy = gripper.policy
        self.ops: dict[str, Handler] = {
            "grip.set": self._grip_set,
            "grip.adjust": self._grip_adjust,
            "grip.hold": self._hold,
            "gripper.activate": self._activate,
            "gripper.close": self._close,
            "gripper.open": self._open,
            "gripper.stop": self._stop,
            "fault.ack": self._acknowledge,
        }

    def _hold(self, request: Request, t_ns: int) -> Result:
        return self._policy.check_lease(request.client, t_ns) or self._gripper.hold()

    def _stop(self, request: Request, t_ns: int) -> Result:
        return self._policy.check_lease(request.client, t_ns) or self._gripper.halt()

    def _acknowledge(self, request: Request, t_ns: int) -> Result:
        return self._policy.check_lease(request.client, t_ns) or self._gripper.acknowledge()

    def _grip_set(self, request: Request, t_ns: int) -> Result:
        return self._refuse(request, t_ns) or self._set_force(float(request.body["force_n"]), t_ns)

    def _grip_adjust(self, request: Request, t_ns: int) -> Result:
        refusal = self._refuse(request, t_ns)
        held_n = self._policy.force_n
        if refusal is not None or held_n is None:
            return refusal or _NOTHING_GRIPPED
        found = self._set_force(held_n + float(request.body["delta_n"]), t_ns)
        return replace(found, field="delta_n") if isinstance(found, Refusal) and found.field else found

    def _set_force(self, force_n: float, t_ns: int) -> Result:
        refusal = self._check_force(force_n, t_ns)
        if refusal is None and self._policy.force_n is None:
            refusal = _NOTHING_GRIPPED
        return refusal or self._gripper.set_force(force_n, t_ns)

    def _close(self, request: Request, t_ns: int) -> Result:
        body = request.body
        force_n = float(body["force_n"])
        refusal = self._refuse(request, t_ns) or self._check_force(force_n, t_ns)
        return refusal or self._gripper.close(force_n, body.get("width_m"), body.get("speed_mps"), t_ns)

    def _open(self, request: Request, t_ns: int) -> Result:
        body = request.body
        refusal = self._refuse(request, t_ns) or self._check_free(request, t_ns)
        return refusal or self._gripper.open(body.get("width_m"), body.get("speed_mps"), t_ns)

    def _activate(self, request: Request, t_ns: int) -> Result:
        refusal = self._policy.check_lease(request.client, t_ns) or self._gripper.may_activate()
        return refusal or self._check_free(request, t_ns) or self._gripper.activate(t_ns)

    def _refuse(self, request: Request, t_ns: int) -> Refusal | None:
        """Why this client cannot move the gripper now."""
        return self._policy.check_lease(request.client, t_ns) or self._gripper.refuse()

    def _check_force(self, force_n: float, t_ns: int) -> Refusal | None:
        """Refuses a force beyond the limits, a change beyond those of a held object, and a raise that nobody feels.

        A change is that of the gripper's settings, which may be steps: the least change asked for may be a whole one.
        """
        refusal = self._gripper.check_force(force_n)
        if refusal is not None:
            return refusal
        applied_n = self._gripper.applied_n(force_n)
        held_n = self._policy.force_n
        refusal = self._policy.check_change(applied_n, t_ns)
        if refusal is not None or held_n is None or applied_n <= held_n:
            return refusal
        blind = [name for name, finger in self._fingers.items() if not finger.feels(t_ns)]
        if not blind:
            return None
        message = f"not to be raised on a stale or doubtful sensor: {', '.join(blind)}; see status"
        return Refusal("not_ready", message, "force_n")

    def _check_free(self, request: Request, t_ns: int) -> Refusal | None:
        """Refuses to open where something is held or may be, unless it is to be dropped."""
        free = {name for name, finger in self._fingers.items() if finger.pressed() is False and finger.feels(t_ns)}
        touching = [name for name in self._fingers if name not in free]
        if not touching or request.body.get("drop", False):
            return None
        message = f"not known to be free: {', '.join(touching)}; drop: true opens all the same"
        return Refusal("in_contact", message, "drop")


def without_gripper(_: Request, __: int) -> Result:
    """Answers every op of `GripDesk` where the config names no gripper."""
    return _NO_GRIPPER
