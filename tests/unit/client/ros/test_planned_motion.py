"""Planned motions from ROS: their points against a known motion, and the answers over DDS."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import ros_values
from ros_values import attributes, header, numbers
from scipy.spatial.transform import Rotation

from slipd_client.errors import NoAnswer
from slipd_client.messages.replies import MotionReply, typed_reply
from slipd_client.ros.conversion import RosMessage

pytest.importorskip("cyclonedds", reason="needs cyclonedds, the extra `ros2`")

from ros_graph import free_domain, joined

from slipd_client.ros.dds import RosPublisher, ros_reader, taken
from slipd_client.ros.motion_advice import PLAN, PlanCheck, PlanError, points_of

DOWN_MPS2 = np.array([0.0, 0.0, -9.80665])
AXIS = np.array([0.6, 0.0, 0.8])
NO_TWIST: dict[str, Any] = {name: dict.fromkeys("xyz", 0.0) for name in ("linear", "angular")}


def course(t_s: float) -> tuple[float, float, float]:
    """Return path, speed and acceleration, from rest to rest in 1 s: 1 m, or 1 rad."""
    return (
        t_s**3 * (10 - 15 * t_s + 6 * t_s**2),
        30 * t_s**2 * (1 - t_s) ** 2,
        60 * t_s * (1 - t_s) * (1 - 2 * t_s),
    )


def point(t_s: float, *, stated: bool = False) -> dict[str, Any]:
    """Return a point of a plan that moves by 1 m along y while it turns by 1 rad about AXIS."""
    path, speed, acceleration = course(t_s)
    turn = Rotation.from_rotvec(AXIS * path).as_quat()
    twists = [{"linear": numbers([0.0, each, 0.0]), "angular": numbers(AXIS * each)} for each in (speed, acceleration)]
    return {
        "transforms": [{"translation": numbers([0.0, path, 0.0]), "rotation": numbers(turn, "xyzw")}],
        "velocities": twists[:1] if stated else [],
        "accelerations": twists[1:] if stated else [],
        "time_from_start": ros_values.time(round(t_s * 1e9)),
    }


def plan(points: list[dict[str, Any]], frame: str = "base", names: tuple[str, ...] = ("virtual_joint",)) -> Any:
    return {"header": header(7_000_000_009, frame), "joint_names": list(names), "points": points}


@pytest.mark.parametrize(("stated", "step_s", "within"), [(True, 0.1, 1e-9), (False, 0.01, 0.35)])
def test_a_plan_gives_what_the_gripper_feels(stated: bool, step_s: float, within: float) -> None:
    times = np.arange(0.0, 1.0 + step_s / 2, step_s)
    found = np.array(points_of(attributes(plan([point(t_s, stated=stated) for t_s in times])), "base", "tool0"))
    assert np.all(np.diff(found[:, 0]) > 0.0)
    for row in found[(found[:, 0] >= 0.0) & (found[:, 0] <= 1.0)]:
        path, speed, acceleration = course(row[0])
        felt = Rotation.from_rotvec(AXIS * path).inv().apply(DOWN_MPS2 - [0.0, acceleration, 0.0])
        assert row[1:4] == pytest.approx(felt, abs=within)
        assert row[4:7] == pytest.approx(AXIS * speed, abs=within)
        assert row[7:] == pytest.approx(AXIS * acceleration, abs=within)
    if not stated:
        assert found[0, 1:] == pytest.approx([*DOWN_MPS2, *[0.0] * 6], abs=0.01), "at rest before the first pose"


TOO_SHORT = "a plan must have at least two points, at rising times"
STILL = [point(0.0), point(0.01)]
NOWHERE = {"translation": numbers([9, 9, 9]), "rotation": numbers([0, 0, 0, 2], "xyzw")}
LONG_ROTATION = STILL[1] | {"transforms": [NOWHERE]}
ELSEWHERE = NOWHERE | {"rotation": numbers([1, 0, 0, 0], "xyzw")}
TWO_FRAMES = [each | {"transforms": [ELSEWHERE, *each["transforms"]]} for each in map(point, (0.0, 0.01, 0.02))]


def test_the_frame_of_the_hand_is_found_among_others() -> None:
    found = points_of(attributes(plan(TWO_FRAMES, names=("camera", "tool0"))), "base", "tool0")
    assert found == points_of(attributes(plan([point(t_s) for t_s in (0.0, 0.01, 0.02)])), "base", "tool0")


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        (plan(STILL, frame="camera"), "the poses must be in 'base', whose Z points up, got 'camera'"),
        (plan(TWO_FRAMES, names=("one", "two")), "joint_names must have 'tool0', got one, two"),
        (plan(STILL, names=()), "joint_names must have 'tool0', got none"),
        (plan(STILL[:1]), TOO_SHORT),
        (plan([STILL[0], STILL[0]]), TOO_SHORT),
        (plan([point(1e-4 * n) for n in range(2001)]), "a plan must have at most 2,000 points, got 2,001"),
        (plan([point(0.0), point(0.03)]), "must be at most 20 ms apart, got 30 ms"),
        (plan([point(0.0), STILL[1] | {"transforms": []}]), "every point must have a transform"),
        (
            plan([STILL[0], LONG_ROTATION]),
            "the rotation at 0.01 s must be a unit quaternion x y z w, got one of length 2",
        ),
    ],
)
def test_a_plan_that_cannot_be_checked_is_refused_with_the_reason(wrong: Any, complaint: str) -> None:
    with pytest.raises(PlanError, match=re.escape(complaint)):
        points_of(attributes(wrong), "base", "tool0")


def silent(_: list[list[float]]) -> MotionReply:
    raise NoAnswer("the daemon is silent")


def holds(points: list[list[float]]) -> MotionReply:
    known = {"utilisation": 0.5, "at_s": points[-1][0], "finger": "left", "mode": "rotation", "time_scale": 1.0}
    return typed_reply(MotionReply, known | {"grip_needed_n": 4.0, "unknown": None})


PLANNED = [point(t_s, stated=True) for t_s in (0.0, 0.5, 1.0)]


@pytest.mark.parametrize(
    ("check", "points", "answer"),
    [
        (holds, PLANNED, ("0.5", "1.0", "left", "rotation", "1.0", "")),
        (silent, PLANNED, ("nan", "nan", "unknown", "unknown", "nan", "the daemon is silent")),
        (holds, PLANNED[:1], ("nan", "nan", "unknown", "unknown", "nan", TOO_SHORT)),
    ],
)
def test_a_planner_gets_an_answer_with_the_header_of_its_plan(
    check: Callable[[list[list[float]]], MotionReply], points: list[dict[str, Any]], answer: tuple[str, ...]
) -> None:
    with joined(free_domain()) as participant:
        publisher = RosPublisher(participant, {})
        answers = ros_reader(participant, "/slipd/motion_check", "slipd_msgs/MotionCheck", reliable=True)
        plans = ros_reader(participant, "/plan", PLAN, reliable=True)
        checker = PlanCheck(plans, RosPublisher(participant, {}).publish, "/slipd/motion_check", check, "base", "tool0")
        checker.start()
        until_s, heard = time.monotonic() + 40, list[Any]()
        while not heard and time.monotonic() < until_s:
            publisher.publish(RosMessage("/plan", PLAN, plan(points)))
            time.sleep(0.05)
            heard = taken(answers)
        checker.stop()
    found = heard[0]
    assert (found.header.stamp.sec, found.header.stamp.nanosec, found.header.frame_id) == (7, 9, "base")
    values = found.utilisation, found.at_s, found.finger, found.mode, found.time_scale, found.unknown
    assert tuple(map(str, values)) == answer
