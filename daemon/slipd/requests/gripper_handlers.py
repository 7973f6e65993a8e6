"""Handlers of the requests about the gripper: each motion becomes an intent, which the motion gate judges."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from slipd.events import Request
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.no_gripper import NoGripper
from slipd.publish import replies
from slipd.publish.replies import Result
from slipd.types.refusal import Refusal

Handler = Callable[[Request, int], Result]
"""Carries out a checked request at a time, or refuses it."""


def gripper_handlers(gripper: GripperControl | NoGripper) -> dict[str, Handler]:
    """Return the handler of each op about the gripper; without a gripper each of them is refused."""
    if isinstance(gripper, NoGripper):
        return dict.fromkeys(_HANDLERS, _refuse)
    return {op: partial(handler, gripper) for op, handler in _HANDLERS.items()}


def _refuse(_: Request, __: int) -> Result:
    return Refusal("no_gripper", "the config has no [gripper]")


def _acknowledge(gripper: GripperControl, request: Request, t_ns: int) -> Result:
    fault = gripper.policy.fault
    refusal = gripper.policy.lease.check(request.client, t_ns) or gripper.acknowledge()
    return refusal or replies.fault_acknowledged(fault)


def _hold(gripper: GripperControl, request: Request, t_ns: int) -> Result:
    return gripper.carry_out("hold", t_ns, request.client) or replies.force_held(gripper)


def _stop(gripper: GripperControl, request: Request, t_ns: int) -> Result:
    return gripper.carry_out("stop", t_ns, request.client) or replies.done()


def _set_force(gripper: GripperControl, request: Request, t_ns: int) -> Result:
    force_n = float(request.body["force_n"])
    return gripper.carry_out("set", t_ns, request.client, force_n=force_n) or replies.force_applied(gripper)


def _adjust_force(gripper: GripperControl, request: Request, t_ns: int) -> Result:
    held_n, delta_n = gripper.policy.force_n, float(request.body["delta_n"])
    force_n = None if held_n is None else held_n + delta_n
    return gripper.carry_out("adjust", t_ns, request.client, force_n=force_n) or replies.force_applied(gripper)


def _close(gripper: GripperControl, request: Request, t_ns: int) -> Result:
    body = request.body
    refusal = gripper.carry_out(
        "close",
        t_ns,
        request.client,
        force_n=float(body["force_n"]),
        width_m=body.get("width_m"),
        speed_mps=body.get("speed_mps"),
    )
    return refusal or replies.force_applied(gripper)


def _open(gripper: GripperControl, request: Request, t_ns: int) -> Result:
    body = request.body
    refusal = gripper.carry_out(
        "open",
        t_ns,
        request.client,
        width_m=body.get("width_m"),
        speed_mps=body.get("speed_mps"),
        drop=body.get("drop", False),
    )
    return refusal or replies.force_applied(gripper)


def _activate(gripper: GripperControl, request: Request, t_ns: int) -> Result:
    drop = request.body.get("drop", False)
    return gripper.carry_out("activate", t_ns, request.client, drop=drop) or replies.done()


_HANDLERS: dict[str, Callable[[GripperControl, Request, int], Result]] = {
    "grip.set": _set_force,
    "grip.adjust": _adjust_force,
    "grip.hold": _hold,
    "gripper.activate": _activate,
    "gripper.close": _close,
    "gripper.open": _open,
    "gripper.stop": _stop,
    "fault.ack": _acknowledge,
}
