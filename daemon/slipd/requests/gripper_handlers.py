"""Handlers of the requests about the gripper: each motion becomes an intent, which the motion gate judges."""

from __future__ import annotations

from collections.abc import Callable

from slipd.events import Request
from slipd.gripper.gripper_control import GripperControl
from slipd.publish import replies
from slipd.publish.replies import Result
from slipd.refusal import Refusal

#: Carries out a checked request at a time, or refuses it.
Handler = Callable[[Request, int], Result]

_NO_GRIPPER = Refusal("no_gripper", "the config has no [gripper]")


class GripperHandlers:
    """Turn requests about the gripper into intents.

    Args:
        gripper: The gripper.

    Attributes:
        ops: Handler of each op.
    """

    def __init__(self, gripper: GripperControl) -> None:
        self._gripper = gripper
        self._policy = gripper.policy
        self.ops: dict[str, Handler] = {
            "grip.set": self._grip_set,
            "grip.adjust": self._grip_adjust,
            "grip.hold": self._grip_hold,
            "gripper.activate": self._activate,
            "gripper.close": self._close,
            "gripper.open": self._open,
            "gripper.stop": self._stop,
            "fault.ack": self._acknowledge,
        }

    def _acknowledge(self, request: Request, t_ns: int) -> Result:
        fault = self._policy.fault
        refusal = self._policy.check_lease(request.client, t_ns) or self._gripper.acknowledge()
        return refusal or replies.fault_acknowledged(fault)

    def _grip_hold(self, request: Request, t_ns: int) -> Result:
        return self._gripper.carry_out("hold", t_ns, request.client) or replies.force_held(self._gripper)

    def _stop(self, request: Request, t_ns: int) -> Result:
        return self._gripper.carry_out("stop", t_ns, request.client) or replies.done()

    def _grip_set(self, request: Request, t_ns: int) -> Result:
        force_n = float(request.body["force_n"])
        refusal = self._gripper.carry_out("set", t_ns, request.client, force_n=force_n)
        return refusal or replies.force_applied(self._gripper)

    def _grip_adjust(self, request: Request, t_ns: int) -> Result:
        held_n, delta_n = self._policy.force_n, float(request.body["delta_n"])
        force_n = None if held_n is None else held_n + delta_n
        refusal = self._gripper.carry_out("adjust", t_ns, request.client, force_n=force_n)
        return refusal or replies.force_applied(self._gripper)

    def _close(self, request: Request, t_ns: int) -> Result:
        body = request.body
        refusal = self._gripper.carry_out(
            "close",
            t_ns,
            request.client,
            force_n=float(body["force_n"]),
            width_m=body.get("width_m"),
            speed_mps=body.get("speed_mps"),
        )
        return refusal or replies.force_applied(self._gripper)

    def _open(self, request: Request, t_ns: int) -> Result:
        body = request.body
        refusal = self._gripper.carry_out(
            "open",
            t_ns,
            request.client,
            width_m=body.get("width_m"),
            speed_mps=body.get("speed_mps"),
            drop=body.get("drop", False),
        )
        return refusal or replies.force_applied(self._gripper)

    def _activate(self, request: Request, t_ns: int) -> Result:
        drop = request.body.get("drop", False)
        return self._gripper.carry_out("activate", t_ns, request.client, drop=drop) or replies.done()


def without_gripper(_: Request, __: int) -> Result:
    """Refuse every request of `GripperHandlers` where the config names no gripper."""
    return _NO_GRIPPER
