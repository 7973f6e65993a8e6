"""Arguments of ``slipctl ros2``."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from slipd_client.argument_types import Add, finite, rate_hz
from slipd_client.errors import CallError
from slipd_client.ros.topic_names import NAMESPACE, TRANSFORMS_TOPIC
from slipd_client.ros2.ros_environment import check_domain

_TOPIC = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


def add_ros2(add: Add) -> None:
    """Add the command; ``add`` adds a command, given its name and help text."""
    ros2 = add("ros2", "publish the messages as ROS 2 topics, and take the arm's orientation from ROS (docs/ros2.md)")
    ros2.add_argument(
        "--config", type=Path, metavar="FILE", help="config of the daemon: the places of its pads become /tf"
    )
    ros2.add_argument(
        "--domain", type=_domain, metavar="ID", help="id of the DDS domain (default: ROS_DOMAIN_ID, or 0)"
    )
    ros2.add_argument(
        "--prefix",
        type=_topic,
        default=NAMESPACE,
        metavar="/NAME",
        help="beginning of the topics, in the place of %(default)s",
    )
    ros2.add_argument(
        "--wrench-rate",
        type=rate_hz,
        metavar="HZ",
        help="publish at most so many wrenches per second of each finger; those between are left out (default: all)",
    )
    ros2.add_argument(
        "--hand",
        type=_frame,
        metavar="FRAME",
        help="frame of the robot that is the gripper's frame of the config: /tf_static joins them",
    )
    orientation = ros2.add_mutually_exclusive_group()
    orientation.add_argument(
        "--orientation-from",
        type=_frame,
        metavar="FRAME",
        help="send the daemon the orientation of --hand in this frame, whose Z points up, by the transforms; "
        "needs --config",
    )
    orientation.add_argument(
        "--imu",
        type=_topic,
        metavar="/TOPIC",
        help="send the daemon the orientation by this sensor_msgs/Imu on the gripper; needs --config",
    )
    ros2.add_argument(
        "--imu-mount",
        nargs=4,
        type=finite,
        metavar=("X", "Y", "Z", "W"),
        help="orientation of the IMU in the gripper's frame, unit quaternion (default: 0 0 0 1)",
    )
    ros2.add_argument(
        "--tf-topic",
        type=_topic,
        default=TRANSFORMS_TOPIC,
        metavar="/TOPIC",
        help="topic of the transforms; the static ones have _static appended (default: %(default)s)",
    )


def _domain(text: str) -> int:
    try:
        return check_domain(text, "the id of a domain")
    except CallError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _topic(text: str) -> str:
    if not _TOPIC.fullmatch(text):
        raise argparse.ArgumentTypeError(f"must be the full name of a topic, such as /arm/slipd, got {text!r:.80}")
    return text


def _frame(text: str) -> str:
    if not text or text.startswith("/"):
        raise argparse.ArgumentTypeError(f"must be the name of a frame, without a leading slash, got {text!r:.80}")
    return text
