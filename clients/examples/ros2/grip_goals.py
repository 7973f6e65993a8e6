"""Goals of ``control_msgs/action/ParallelGripperCommand``, carried out by slipd from the lease to the outcome. No ROS.

The joint's position is that of one joint; the width between the pads is ``width_at_zero_m + width_per_position ×
position``. The effort is the grip force on one pad, N. Messages are objects with the fields of their types.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from slipd_client.errors import ClientError
from slipd_client.grip import GripClient
from slipd_client.messages.typed import Gripper
from slipd_client.subscriber import Subscriber


class GoalError(ValueError):
    """A goal that cannot be carried out; the text says why."""


@dataclass(frozen=True)
class Joint:
    """How the joint of the gripper and the width between the pads belong together.

    Attributes:
        name: Name of the joint.
        width_per_position: Width per unit of position, m/m or m/rad; 2 where each finger travels by the position.
        width_at_zero_m: Width at position 0.
        default_force_n: Grip force of a goal without an effort; None: such a goal is refused.
        tolerance_m: A width is reached within this.
    """

    name: str
    width_per_position: float = 1.0
    width_at_zero_m: float = 0.0
    default_force_n: float | None = None
    tolerance_m: float = 0.001

    def width_m(self, position: float) -> float:
        """Return the width between the pads at a position."""
        return self.width_at_zero_m + self.width_per_position * position

    def position(self, width_m: float) -> float:
        """Return the position at a width."""
        return (width_m - self.width_at_zero_m) / self.width_per_position


class Motion(NamedTuple):
    """What is asked of slipd.

    Attributes:
        closes: ``gripper.close``; otherwise ``gripper.open``.
        width_m: Width to move to.
        force_n: Grip force on one pad when closing.
        speed_mps: Largest speed of the width; None: the gripper's own.
    """

    closes: bool
    width_m: float
    force_n: float
    speed_mps: float | None


class Outcome(NamedTuple):
    """How a motion ended, as in the result of the action."""

    stalled: bool
    reached_goal: bool


def motion_of(command: Any, joint: Joint, width_m: float | None) -> Motion:
    """Return the motion that a goal asks for.

    Args:
        command: ``sensor_msgs/JointState`` of the goal.
        joint: The gripper's joint.
        width_m: Present width; None: not known.

    Raises:
        GoalError: The goal is not one for this joint, or slipd does not know the present width.
    """
    if width_m is None:
        raise GoalError("the width of the gripper is not known: it does not answer")
    names = list(command.name)
    if names != [joint.name]:
        raise GoalError(f"the goal must name the joint {joint.name!r} alone, got {names}")
    target_m = joint.width_m(_number("position", command.position))
    if target_m < -joint.tolerance_m:
        raise GoalError(f"the position must not make the width between the pads negative, got {target_m:.4g} m")
    target_m = max(target_m, 0.0)
    speed = None
    if command.velocity:
        speed = abs(_number("velocity", command.velocity) * joint.width_per_position) or None
    if target_m > width_m:
        return Motion(closes=False, width_m=target_m, force_n=0.0, speed_mps=speed)
    force_n = _number("effort", command.effort) if command.effort else joint.default_force_n
    if not force_n or force_n < 0.0:
        raise GoalError("closing needs an effort above 0: the grip force on one pad, N")
    return Motion(closes=True, width_m=target_m, force_n=force_n, speed_mps=speed)


def outcome_of(motion: Motion, gripper: Mapping[str, Any], joint: Joint) -> Outcome | None:
    """Return how a motion ended; None while it goes on, and while the gripper does not answer.

    Args:
        motion: The motion that slipd accepted.
        gripper: A message ``gripper`` of slipd that was published after the reply.
        joint: The gripper's joint.

    Raises:
        GoalError: The gripper reports a fault, or is no longer active.
    """
    if fault := gripper["fault"] or gripper["latched_fault"]:
        raise GoalError(f"the gripper reports a fault: {fault}")
    if gripper["active"] is False:
        raise GoalError("the gripper is no longer active")
    if gripper["width_m"] is None or gripper["object"] in (None, "moving") or gripper["moving"]:
        return None
    stalled = gripper["object"] == ("contact_closing" if motion.closes else "contact_opening")
    return Outcome(stalled, abs(gripper["width_m"] - motion.width_m) <= joint.tolerance_m)


def joint_state(gripper: Mapping[str, Any], joint: Joint) -> dict[str, list[Any]]:
    """Return the fields of a ``sensor_msgs/JointState``; a value that is not known is NaN."""
    width_m, force_n = gripper["width_m"], gripper["force_command_n"]
    return {
        "name": [joint.name],
        "position": [math.nan if width_m is None else joint.position(width_m)],
        "effort": [math.nan if force_n is None else force_n],
    }


def _number(field: str, values: Sequence[float]) -> float:
    if len(values) != 1 or not math.isfinite(values[0]):
        raise GoalError(f"{field} of the goal must be one finite number, got {list(values)}")
    return float(values[0])


PATIENCE_S = 15.0
"""A motion that takes longer has failed."""

START_S = 1.0
"""Fingers that neither moved nor reached something by then will not: some grippers report a motion late."""

LOOK_S = 0.05
"""Time between two looks at whether the goal was cancelled."""


def carry_out(
    client: GripClient,
    messages: Subscriber,
    command: Any,
    joint: Joint,
    *,
    cancelled: Callable[[], bool],
    feedback: Callable[[Mapping[str, Any]], object],
) -> tuple[Outcome | None, Mapping[str, Any]]:
    """Move the gripper as a goal asks for, and return how it ended, and the gripper's last message.

    The lease is held while the fingers move. Its end moves nothing: slipd keeps the grip force, and a client that
    answers warnings may then raise it.

    Args:
        client: Sends the requests, all from this thread.
        messages: A subscriber of ``gripper``.
        command: ``sensor_msgs/JointState`` of the goal.
        joint: The gripper's joint.
        cancelled: Returns whether the goal was cancelled; the fingers then stop, and the outcome is None.
        feedback: Receives every message of the gripper on the way.

    Raises:
        GoalError: The goal cannot be carried out, slipd refused it, the fingers stopped for nothing, or did not stop in
            time.
    """
    try:
        gripper = client.status()["gripper"]
        if gripper is None:
            raise GoalError("slipd's config has no gripper")
        motion = motion_of(command, joint, gripper["width_m"])
        with client.lease():
            _start(client, motion)
            started_s = time.monotonic()
            state: Mapping[str, Any] = {}
            while (passed_s := time.monotonic() - started_s) < PATIENCE_S:
                if cancelled():
                    client.grip_hold()
                    return None, state
                message = messages.receive(LOOK_S)
                if not isinstance(message, Gripper) or (message.age_by(client.clock) or 0.0) > passed_s:
                    continue
                state = message.raw
                feedback(state)
                outcome = outcome_of(motion, state, joint)
                if outcome is not None and any(outcome):
                    return outcome, state
                if outcome is not None and passed_s > START_S:
                    raise GoalError("the fingers stopped before the goal, without contact")
            client.grip_hold()
    except ClientError as error:
        raise GoalError(str(error)) from error
    raise GoalError(f"the gripper still moved after {PATIENCE_S:g} s, and was stopped")


def _start(client: GripClient, motion: Motion) -> None:
    if motion.closes:
        client.gripper_close(motion.force_n, motion.width_m, motion.speed_mps)
    else:
        client.gripper_open(width_m=motion.width_m, speed_mps=motion.speed_mps)
