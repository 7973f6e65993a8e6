"""Handler of the request whether the grip holds a motion: it moves nothing, and changes nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from slipd.events import Request
from slipd.grasp.motion_advice import MotionAdvice
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.no_gripper import NoGripper
from slipd.publish import replies
from slipd.publish.message_sequencer import Body
from slipd.signals.gravity import MOST_GRAVITY_MPS2
from slipd.types.arrays import Array
from slipd.types.refusal import Refusal, RefusalError
from slipd_client.messages.schema.request_fields import MOST_POINTS, POINT_COLUMNS

_EITHER = "either points or acceleration_mps2 must be there, not both"
_WIDTH = len(POINT_COLUMNS)


class MotionHandlers:
    """Check motions against the present grip.

    Args:
        advice: The advice; None: the config has no ``[grasp]``.
        gripper: Measures the width between the pads.
    """

    def __init__(self, advice: MotionAdvice | None, gripper: GripperControl | NoGripper) -> None:
        self._advice, self._gripper = advice, gripper

    def check(self, request: Request, t_ns: int) -> Body:
        """Carry out ``motion.check``."""
        body = request.body
        if ("points" in body) is ("acceleration_mps2" in body):
            raise RefusalError(Refusal("missing_field", _EITHER, "points"))
        if self._advice is None:
            rule = "the config has no [grasp], so that the load on both fingers together is not known"
            raise RefusalError(Refusal("not_ready", rule))
        if "points" in body:
            return replies.motion_checked(self._advice.check(_table(body["points"]), t_ns, self._gripper.width_m))
        acceleration: list[float] = body["acceleration_mps2"]
        if not math.hypot(*acceleration) <= MOST_GRAVITY_MPS2:
            rule = f"acceleration_mps2 must be at most {MOST_GRAVITY_MPS2:.1f} m/s² (5 g) long"
            raise RefusalError(Refusal("out_of_range", rule, "acceleration_mps2"))
        return replies.motion_checked(self._advice.check_acceleration(acceleration, t_ns, self._gripper.width_m))


def _table(points: list[Any]) -> Array:
    """Return the points as an array, shape (n, 10); refuse rows that are none, and name the first of them."""
    if not 1 <= len(points) <= MOST_POINTS:
        raise _wrong("out_of_range", f"points must have 1 to {MOST_POINTS} rows, got {len(points)}", "points")
    for index, row in enumerate(points):
        if type(row) is not list or len(row) != _WIDTH or not set(map(type, row)) <= {float, int}:
            raise _wrong("bad_type", f"row {index} of points must be a list of {_WIDTH} numbers", f"points.{index}")
    table = np.array(points, np.float64)
    if not np.isfinite(table).all():
        index = int(np.argmin(np.isfinite(table).all(axis=1)))
        raise _wrong("not_finite", f"row {index} of points must be finite", f"points.{index}")
    _refuse_first(np.diff(table[:, 0], prepend=-math.inf) <= 0.0, points, "t_s must be above that of the row before")
    too_long = np.linalg.norm(table[:, 1:4], axis=1) > MOST_GRAVITY_MPS2
    _refuse_first(too_long, points, f"gravity_mps2 must be at most {MOST_GRAVITY_MPS2:.1f} m/s² (5 g) long")
    return table


def _refuse_first(wrong: Any, points: Sequence[Any], rule: str) -> None:
    if wrong.any():
        index = int(np.argmax(wrong))
        raise _wrong("out_of_range", f"row {index} of points: {rule}, got {points[index]!r:.80}", f"points.{index}")


def _wrong(code: str, rule: str, field: str) -> RefusalError:
    return RefusalError(Refusal(code, rule, field))
