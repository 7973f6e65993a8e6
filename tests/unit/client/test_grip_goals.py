"""Goals of the gripper action as requests to slipd, and how they end."""

from __future__ import annotations

import math
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


def test_a_goal_narrower_than_the_width_closes_with_its_effort_and_a_wider_one_opens() -> None:
    narrower = command(0.045, effort=(8.0,), velocity=(0.02,))
    assert motion_of(narrower, FINGER, 0.08) == Motion(True, pytest.approx(0.01), 8.0, 0.04)
    assert motion_of(command(0.0, effort=(8.0,)), FINGER, 0.08) == Motion(False, 0.1, 0.0, None)
    assert motion_of(command(0.01, effort=(8.0,)), FINGER, 0.08).closes


def test_a_goal_without_effort_takes_the_default_force_where_there_is_one() -> None:
    assert motion_of(command(0.05), Joint("finger", -2.0, 0.1, default_force_n=5.0), 0.08).force_n == 5.0
    with pytest.raises(GoalError, match="closing needs an effort above 0"):
        motion_of(command(0.05), FINGER, 0.08)
    assert not motion_of(command(0.0), FINGER, 0.08).closes


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        (SimpleNamespace(name=["other"], position=[0.0], effort=(), velocity=()), "must name the joint 'finger' alone"),
        (SimpleNamespace(name=[], position=[0.0], effort=(), velocity=()), "must name the joint 'finger' alone"),
        (command(math.nan), "position of the goal must be one finite number"),
        (command(0.06, effort=(5.0,)), "negative, got -0.02 m"),
        (command(0.05, effort=(-1.0,)), "closing needs an effort above 0"),
        (command(0.05, effort=(math.inf,)), "effort of the goal must be one finite number"),
        (command(0.05, effort=(1.0, 2.0)), "effort of the goal must be one finite number"),
        (command(0.05, effort=(1.0,), velocity=(math.nan,)), "velocity of the goal must be one finite number"),
    ],
)
def test_a_goal_that_is_wrong_is_refused(goal: Any, why: str) -> None:
    with pytest.raises(GoalError, match=why):
        motion_of(goal, FINGER, 0.08)


def test_no_goal_is_accepted_while_the_width_is_not_known() -> None:
    with pytest.raises(GoalError, match="it does not answer"):
        motion_of(command(0.0), FINGER, None)


def test_a_motion_ends_at_the_goal_at_an_object_or_where_the_fingers_stop() -> None:
    close = Motion(True, 0.0, 8.0, None)
    assert outcome_of(close, {**GRIPPER, "moving": True}, FINGER) is None
    assert outcome_of(close, {**GRIPPER, "object": "moving"}, FINGER) is None
    assert outcome_of(close, dict.fromkeys(GRIPPER), FINGER) is None
    assert outcome_of(close, {**GRIPPER, "object": "contact_closing"}, FINGER) == Outcome(True, False)
    assert outcome_of(close, {**GRIPPER, "width_m": 0.0005}, FINGER) == Outcome(False, True)
    assert outcome_of(close, GRIPPER, FINGER) == Outcome(False, False)
    held = {**GRIPPER, "object": "contact_closing"}
    assert outcome_of(Motion(False, 0.06, 0.0, None), held, FINGER) == Outcome(False, False)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"fault": "overheated"}, "reports a fault: overheated"),
        ({"latched_fault": "lost"}, "reports a fault: lost"),
        ({"active": False}, "no longer active"),
    ],
)
def test_a_fault_ends_a_motion(change: dict[str, Any], why: str) -> None:
    with pytest.raises(GoalError, match=why):
        outcome_of(Motion(True, 0.0, 8.0, None), GRIPPER | change, FINGER)


def test_the_state_of_the_joint_is_position_and_grip_force() -> None:
    assert joint_state(GRIPPER, FINGER) == {"name": ["finger"], "position": [pytest.approx(0.03)], "effort": [8.0]}
    unknown = joint_state(dict.fromkeys(GRIPPER), FINGER)
    assert math.isnan(unknown["position"][0])
    assert math.isnan(unknown["effort"][0])
