"""One motion of the gripper, from the lease to its outcome. Needs a daemon, and no ROS."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from grip_goals import GoalError, Joint, Motion, Outcome, motion_of, outcome_of

from slipd_client.errors import ClientError
from slipd_client.grip import GripClient
from slipd_client.messages.typed import Gripper
from slipd_client.subscriber import Subscriber

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
