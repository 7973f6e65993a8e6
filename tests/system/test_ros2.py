"""A real daemon, `slipctl serve ros2`, and a robot that is another participant of its DDS domain."""

from __future__ import annotations

import asyncio
import os
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from loop_waits import eventually
from ros_peers import typestore
from service_rig import RIG, Rig, serving

pytest.importorskip("cyclonedds", reason="needs cyclonedds, the extra `ros2`")

from ros_graph import free_domain, joined, reader

from slipd_client.ros.conversion import RosMessage
from slipd_client.ros.dds import RosPublisher

pytestmark = pytest.mark.process

STORE = typestore()
PADS = """
[grasp.pads.left]
positions = [[0.0, 0.0, 0.0, 0.0], [0.1, 0.0, 0.05, 0.0]]
quat_xyzw = [0.5, -0.5, 0.5, 0.5]
"""


def imu() -> RosMessage:
    """Return a message of an IMU that is upright."""
    sec, nanosec = divmod(time.time_ns(), 10**9)
    vectors = {name: dict.fromkeys("xyz", 0.0) for name in ("angular_velocity", "linear_acceleration")}
    covariances = {f"{name}_covariance": [0.0] * 9 for name in ("orientation", *vectors)}
    orientation = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    header = {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": "imu"}
    value = {"header": header, "orientation": orientation, **vectors, **covariances}
    return RosMessage("/imu", "sensor_msgs/Imu", value)


ZERO = dict.fromkeys("xyz", 0.0)
POINTS = [
    {
        "transforms": [{"translation": ZERO, "rotation": ZERO | {"w": 1.0}}],
        "velocities": [{"linear": ZERO, "angular": ZERO}],
        "accelerations": [{"linear": ZERO, "angular": ZERO}],
        "time_from_start": {"sec": sec, "nanosec": 0},
    }
    for sec in (0, 1)
]
PLAN = RosMessage(
    "/plan",
    "trajectory_msgs/MultiDOFJointTrajectory",
    {"header": {"stamp": {"sec": 7, "nanosec": 0}, "frame_id": "base"}, "joint_names": ["tool0"], "points": POINTS},
)
"""A gripper that stands still."""


async def test_the_daemon_takes_the_orientation_of_an_imu_its_messages_reach_ros_and_it_checks_plans(
    rig: Rig, tmp_path: Path
) -> None:
    variables = free_domain()
    text = RIG.format(wrench=rig.wrench.path, pad=rig.pad.path).replace(
        'device = "bota"', 'device = "bota"\nmass_kg = 0.02'
    )
    rig.file.write_text(text, encoding="utf-8")
    (tmp_path / "pads.toml").write_text(PADS, encoding="utf-8")
    async with serving(rig.config) as client:
        endpoints = ("--publish", client.endpoints.publish, "--requests", client.endpoints.requests)
        serve = ("serve", "ros2", "--config", str(tmp_path / "pads.toml"), "--imu", "/imu")
        command = (*endpoints, *serve, "--check-plans", "/plan", "--plan-frame", "base")
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "slipd_client.slipctl", *command, env=os.environ | variables
        )
        with joined(variables) as participant:
            try:
                arm = RosPublisher(participant, {})
                wrenches = reader(participant, "/slipd/left/wrench", "geometry_msgs/WrenchStamped", latched=False)

                def move() -> None:
                    arm.publish(imu())
                    rig.wrench.send_wrench()

                def compensated() -> bool:
                    statuses = client.hear("status")
                    return bool(statuses) and statuses[-1]["streams"]["left.wrench"]["gravity"] == "compensated"

                await eventually(compensated, move)
                sample: Any = (await eventually(lambda: wrenches.take(1), move))[0]
                message = STORE.deserialize_cdr(sample.data, "geometry_msgs/msg/WrenchStamped")
                assert message.header.frame_id == "left_pad"
                answers = reader(participant, "/slipd/motion_check", "slipd_msgs/MotionCheck", latched=False)
                sample = (await eventually(lambda: answers.take(1), lambda: arm.publish(PLAN)))[0]
                answer = STORE.deserialize_cdr(sample.data, "slipd_msgs/msg/MotionCheck")
                assert (answer.header.stamp.sec, answer.unknown != "") == (7, True)
            finally:
                process.terminate()
                await process.wait()
