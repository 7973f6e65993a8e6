"""Handlers of the requests about the lease and the gripper: each motion becomes an intent for the motion gate."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from slipd.events import Request
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.intent import IntentKind
from slipd.gripper.lease import Lease
from slipd.gripper.no_gripper import NoGripper
from slipd.publish import replies
from slipd.publish.message_sequencer import Body
from slipd.types.refusal import Refusal, RefusalError, require

Handler = Callable[[Request, int], Body]
"""Carries out a checked request at a time; raises RefusalError where a rule forbids it."""

_MOTIONS: dict[str, tuple[IntentKind, Callable[[GripperControl], Body]]] = {
    "grip.set": ("set", replies.force_applied),
    "grip.adjust": ("adjust", replies.force_applied),
    "grip.hold": ("hold", replies.force_held),
    "gripper.activate": ("activate", replies.done),
    "gripper.close": ("close", replies.force_applied),
    "gripper.open": ("open", replies.force_applied),
    "gripper.stop": ("stop", replies.done),
}
"""Kind of intent of each op, and its result."""


def grip_handlers(gripper: GripperControl | NoGripper) -> dict[str, Handler]:
    """Return the handler of each op about the lease and the gripper; without a gripper none moves anything."""
    lease = gripper.policy.lease
    leases: dict[str, Handler] = {
        "lease.acquire": partial(_acquire, lease),
        "lease.renew": partial(_keep, lease.renew),
        "lease.release": partial(_keep, lease.release),
    }
    if isinstance(gripper, NoGripper):
        return leases | dict.fromkeys((*_MOTIONS, "fault.ack"), _refuse)
    motions = {op: partial(_carry_out, gripper, *intent) for op, intent in _MOTIONS.items()}
    return leases | motions | {"fault.ack": partial(_acknowledge, gripper)}


def _acquire(lease: Lease, request: Request, t_ns: int) -> Body:
    ttl_ms = request.body["ttl_ms"]
    require(lease.acquire(request.client, ttl_ms, t_ns))
    return replies.lease_granted(ttl_ms)


def _keep(change: Callable[[bytes, int], Refusal | None], request: Request, t_ns: int) -> Body:
    require(change(request.client, t_ns))
    return replies.done()


def _refuse(_: Request, __: int) -> Body:
    raise RefusalError(Refusal("no_gripper", "the config has no [gripper]"))


def _acknowledge(gripper: GripperControl, request: Request, t_ns: int) -> Body:
    fault = gripper.policy.fault
    require(gripper.policy.lease.check(request.client, t_ns) or gripper.acknowledge())
    return replies.fault_acknowledged(fault)


def _carry_out(
    gripper: GripperControl, kind: IntentKind, result: Callable[[GripperControl], Body], request: Request, t_ns: int
) -> Body:
    body, held_n = request.body, gripper.policy.force_n
    wanted = {name: body[name] for name in ("force_n", "width_m", "speed_mps", "drop") if name in body}
    if "delta_n" in body:
        wanted["force_n"] = None if held_n is None else held_n + body["delta_n"]
    require(gripper.carry_out(kind, t_ns, request.client, **wanted))
    return result(gripper)
