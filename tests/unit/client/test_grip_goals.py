"""Goals of the gripper action as requests to slipd, and how they end."""

from __future__ import annotations

import math
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest
from grip_goals import GoalError, Joint, Motion, Outcome, joint_state, motion_of, outcome_of

FINGER = Joint("finger", width_per_position=-2.0, width_at_zero_m=0.1)
"""A joint that closes as its position grows, by 2 mm of width for each mm."""

GRIPPER: dict[str, Any] = {
    "width_m": 0.04,
    "force_command_n": 8.0,
    "active": True,
    "object": "none",
    "moving": False,
    "fault": "",
    "latched_fault": "",
}


def command(position: float, *, effort: tuple[float, ...] = (), velocity: tuple[float, ...] = ()) -> Any:
    return SimpleNamespace(name=["finger"], position=[position], effort=effort, velocity=velocity)


WITH_DEFAULT = Joint("finger", -2.0, 0.1, default_force_n=5.0)


@pytest.mark.parametrize(
    ("goal", "joint", "asked"),
    [
        (command(0.045, effort=(8.0,), velocity=(0.02,)), FINGER, Motion(True, pytest.approx(0.01), 8.0, 0.04)),
        (command(0.01, effort=(8.0,)), FINGER, Motion(True, pytest.approx(0.08), 8.0, None)),
        (command(0.0, effort=(8.0,)), FINGER, Motion(False, 0.1, 0.0, None)),
        (command(0.0), FINGER, Motion(False, 0.1, 0.0, None)),
        (command(0.05), WITH_DEFAULT, Motion(True, 0.0, 5.0, None)),
    ],
)
def test_a_goal_narrower_than_the_width_closes_with_its_effort_and_a_wider_one_opens(
    goal: Any, joint: Joint, asked: Motion
) -> None:
    assert motion_of(goal, joint, 0.08) == asked


OTHER, NONE = (SimpleNamespace(name=names, position=[0.0], effort=(), velocity=()) for names in (["other"], []))


@pytest.mark.parametrize(
    ("goal", "width_m", "why"),
    [
        (OTHER, 0.08, "must name the joint 'finger' alone"),
        (NONE, 0.08, "must name the joint 'finger' alone"),
        (command(math.nan), 0.08, "position of the goal must be one finite number"),
        (command(0.06, effort=(5.0,)), 0.08, "negative, got -0.02 m"),
        (command(0.05), 0.08, "closing needs an effort above 0"),
        (command(0.05, effort=(-1.0,)), 0.08, "closing needs an effort above 0"),
        (command(0.05, effort=(math.inf,)), 0.08, "effort of the goal must be one finite number"),
        (command(0.05, effort=(1.0, 2.0)), 0.08, "effort of the goal must be one finite number"),
        (command(0.05, effort=(1.0,), velocity=(math.nan,)), 0.08, "velocity of the goal must be one finite number"),
        (command(0.0), None, "it does not answer"),
    ],
)
def test_a_goal_that_is_wrong_is_refused(goal: Any, width_m: float | None, why: str) -> None:
    with pytest.raises(GoalError, match=why):
        motion_of(goal, FINGER, width_m)


CLOSE, OPEN = Motion(True, 0.0, 8.0, None), Motion(False, 0.06, 0.0, None)


@pytest.mark.parametrize(
    ("motion", "change", "outcome"),
    [
        (CLOSE, {"moving": True}, None),
        (CLOSE, {"object": "moving"}, None),
        (CLOSE, dict.fromkeys(GRIPPER), None),
        (CLOSE, {"object": "contact_closing"}, Outcome(True, False)),
        (CLOSE, {"width_m": 0.0005}, Outcome(False, True)),
        (CLOSE, {}, Outcome(False, False)),
        (OPEN, {"object": "contact_closing"}, Outcome(False, False)),
        (CLOSE, {"fault": "overheated"}, "reports a fault: overheated"),
        (CLOSE, {"latched_fault": "lost"}, "reports a fault: lost"),
        (CLOSE, {"active": False}, "no longer active"),
    ],
)
def test_a_motion_ends_at_the_goal_at_an_object_by_a_fault_or_where_the_fingers_stop(
    motion: Motion, change: dict[str, Any], outcome: Outcome | str | None
) -> None:
    with pytest.raises(GoalError, match=outcome) if isinstance(outcome, str) else nullcontext():
        assert outcome_of(motion, GRIPPER | change, FINGER) == outcome


def test_the_state_of_the_joint_is_position_and_grip_force() -> None:
    assert joint_state(GRIPPER, FINGER) == {"name": ["finger"], "position": [pytest.approx(0.03)], "effort": [8.0]}
    unknown = [pytest.approx(math.nan, nan_ok=True)]
    assert joint_state(dict.fromkeys(GRIPPER), FINGER) == {"name": ["finger"], "position": unknown, "effort": unknown}
