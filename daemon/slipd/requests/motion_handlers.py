"""Handlers of the requests about the lease, the gripper and motions of the arm.

Each motion of the gripper becomes an intent for the grip gate. The check whether the grip holds a motion of the arm
moves nothing, and changes nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from slipd.events import Body, Request
from slipd.grasp.motion_advice import MotionAdvice
from slipd.gripper.grip_policy import NoGripper
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.intent import IntentKind
from slipd.gripper.lease import Lease
from slipd.publish import replies
from slipd.signals.gravity import MOST_GRAVITY_MPS2
from slipd.types.arrays import Array
from slipd.types.permit import Refusal, RefusalError, require
from slipd_client.messages.request_fields import MOST_POINTS, POINT_COLUMNS

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
    raise RefusalError("no_gripper", "the config has no [gripper]")


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


_EITHER = "either points or acceleration_mps2 must be there, not both"
_WIDTH = len(POINT_COLUMNS)


def check_motion(advice: MotionAdvice | None, gripper: GripperControl | NoGripper, request: Request, t_ns: int) -> Body:
    """Carry out ``motion.check``: does the present grip hold a motion of the arm?

    Args:
        advice: The advice; None: the config has no ``[grasp]``.
        gripper: Measures the width between the pads.
        request: The request.
        t_ns: Now.
    """
    body = request.body
    if ("points" in body) is ("acceleration_mps2" in body):
        raise RefusalError("missing_field", _EITHER, "points")
    if advice is None:
        rule = "the config has no [grasp], so that the load on both fingers together is not known"
        raise RefusalError("not_ready", rule)
    if "points" in body:
        return replies.motion_checked(advice.check(_table(body["points"]), t_ns, gripper.width_m))
    acceleration: list[float] = body["acceleration_mps2"]
    if not math.hypot(*acceleration) <= MOST_GRAVITY_MPS2:
        rule = f"acceleration_mps2 must be at most {MOST_GRAVITY_MPS2:.1f} m/s² (5 g) long"
        raise RefusalError("out_of_range", rule, "acceleration_mps2")
    return replies.motion_checked(advice.check_acceleration(acceleration, t_ns, gripper.width_m))


def _table(points: list[Any]) -> Array:
    """Return the points as an array, shape (n, 10); refuse rows that are none, and name the first of them."""
    if not 1 <= len(points) <= MOST_POINTS:
        raise RefusalError("out_of_range", f"points must have 1 to {MOST_POINTS} rows, got {len(points)}", "points")
    for index, row in enumerate(points):
        if type(row) is not list or len(row) != _WIDTH or not set(map(type, row)) <= {float, int}:
            raise RefusalError(
                "bad_type", f"row {index} of points must be a list of {_WIDTH} numbers", f"points.{index}"
            )
    table = np.array(points, np.float64)
    if not np.isfinite(table).all():
        index = int(np.argmin(np.isfinite(table).all(axis=1)))
        raise RefusalError("not_finite", f"row {index} of points must be finite", f"points.{index}")
    _refuse_first(np.diff(table[:, 0], prepend=-math.inf) <= 0.0, points, "t_s must be above that of the row before")
    too_long = np.linalg.norm(table[:, 1:4], axis=1) > MOST_GRAVITY_MPS2
    _refuse_first(too_long, points, f"gravity_mps2 must be at most {MOST_GRAVITY_MPS2:.1f} m/s² (5 g) long")
    return table


def _refuse_first(wrong: Any, points: Sequence[Any], rule: str) -> None:
    if wrong.any():
        index = int(np.argmax(wrong))
        raise RefusalError(
            "out_of_range", f"row {index} of points: {rule}, got {points[index]!r:.80}", f"points.{index}"
        )
