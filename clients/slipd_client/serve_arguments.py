"""Arguments of ``slipctl serve foxglove``, ``serve ros2`` and ``serve fleet``, and of ``slipctl fleet``."""

from __future__ import annotations

import argparse
import re
import socket
from pathlib import Path

from slipd_client.arguments import (
    DEFAULT_LISTEN,
    Add,
    finite,
    fleet_name,
    matching,
    number_in,
    parse_listen,
    rate_hz,
)
from slipd_client.messages.topics import TOPICS
from slipd_client.ros.conversion import NAMESPACE, TRANSFORMS_TOPIC

FOXGLOVE_LISTEN = "127.0.0.1:8765"
"""The port that Foxglove proposes."""

FLEET = "slipd"
"""Name of the fleet where none is given."""

RATE_HZ = 10.0
"""Most messages per second of each topic but ``warning``, where nothing else is given."""

ENDPOINT = "tcp/10.0.0.1:7447"

_TOPIC = r"(/[A-Za-z_][A-Za-z0-9_]*)+"
_ON_NETWORK = re.compile(r"(tcp|udp|tls|quic|ws)/(\[[0-9A-Fa-f:.%]+\]|[^/:\[\]\s]+):(?P<port>\d{1,5})([?#]\S*)?")
_ON_MACHINE = re.compile(r"unixsock-stream/\S+")


def add_serve(add: Add) -> None:
    """Add the commands of ``slipctl serve``; ``add`` adds a command, given its name and help text."""
    _foxglove(add("foxglove", "serve Foxglove, Lichtblick and PlotJuggler over a WebSocket (docs/viewers.md)"))
    _ros2(add("ros2", "publish ROS 2 topics, and take the arm's motion from ROS (docs/viewers.md)"))
    _fleet_of(add("fleet", "publish the messages of this robot to its fleet over Zenoh (docs/fleet.md)"))


def _foxglove(foxglove: argparse.ArgumentParser) -> None:
    foxglove.add_argument(
        "--listen",
        type=parse_listen,
        default=FOXGLOVE_LISTEN,
        metavar="HOST:PORT",
        help="where to serve (default: %(default)s; port 0: any free one); anyone who can reach it can read everything",
    )
    foxglove.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="config of the daemon: /tf gets the positions of its pads, and the layouts draw lines at its levels",
    )
    foxglove.add_argument(
        "--write-layouts", type=Path, metavar="FOLDER", help="write layouts for these viewers and exit"
    )
    foxglove.add_argument(
        "--fingers",
        nargs="+",
        type=matching("[a-z0-9]{1,32}", "be the name of a finger, a-z and 0-9"),
        default=["left", "right"],
        metavar="NAME",
        help="fingers of the layouts (default: left right)",
    )


def _ros2(ros2: argparse.ArgumentParser) -> None:
    topic = matching(_TOPIC, "be the full name of a topic, such as /arm/slipd")
    frame = matching(r"[^/](?s:.*)", "be the name of a frame, without a leading slash")
    ros2.add_argument(
        "--config", type=Path, metavar="FILE", help="config of the daemon: /tf gets the positions of its pads"
    )
    ros2.add_argument(
        "--domain",
        metavar="ID",
        help="id of the DDS domain (default: ROS_DOMAIN_ID, or 0)",
    )
    ros2.add_argument(
        "--prefix",
        type=topic,
        default=NAMESPACE,
        metavar="/NAME",
        help="beginning of the topics, in the place of %(default)s",
    )
    ros2.add_argument(
        "--wrench-rate",
        type=rate_hz,
        metavar="HZ",
        help="largest number of wrenches per second of each finger; others are left out (default: all)",
    )
    ros2.add_argument(
        "--hand",
        type=frame,
        metavar="FRAME",
        help="frame of the robot that coincides with the gripper's frame of the config: /tf_static joins them",
    )
    orientation = ros2.add_mutually_exclusive_group()
    orientation.add_argument(
        "--orientation-from",
        type=frame,
        metavar="FRAME",
        help="send the daemon the motion of --hand in this frame, whose Z points up, by the transforms: the stream "
        "[grasp.arm] of the config, or the orientation without it; needs --config",
    )
    orientation.add_argument(
        "--imu",
        type=topic,
        metavar="/TOPIC",
        help="send the daemon the motion, or the orientation, by this sensor_msgs/Imu on the gripper; needs --config",
    )
    ros2.add_argument(
        "--imu-mount",
        nargs=4,
        type=finite,
        metavar=("X", "Y", "Z", "W"),
        help="orientation of the IMU in the gripper's frame, unit quaternion (default: 0 0 0 1)",
    )
    ros2.add_argument(
        "--imu-at",
        nargs=3,
        type=finite,
        metavar=("X", "Y", "Z"),
        help="place of the IMU in the gripper's frame, m, for the stream [grasp.arm] (default: 0 0 0)",
    )
    ros2.add_argument(
        "--speed-scaling",
        type=topic,
        metavar="/TOPIC",
        help="publish how fast the arm may go as control_msgs/SpeedScalingFactor, e.g. on "
        "/joint_trajectory_controller/speed_scaling_input; needs --speed-floor",
    )
    ros2.add_argument(
        "--speed-floor",
        type=number_in("from 0 to less than 1", lambda factor: 0.0 <= factor < 1.0),
        metavar="FACTOR",
        help="factor while the speed that holds is not known, from 0 (the arm pauses) to less than 1",
    )
    ros2.add_argument(
        "--check-plans",
        type=topic,
        metavar="/TOPIC",
        help="answer every trajectory_msgs/MultiDOFJointTrajectory of the gripper with a slipd_msgs/MotionCheck on "
        "PREFIX/motion_check: does the grip hold it?",
    )
    ros2.add_argument(
        "--plan-frame",
        type=frame,
        metavar="FRAME",
        help="frame of their poses, whose Z points up (default: that of --orientation-from)",
    )
    ros2.add_argument(
        "--tf-topic",
        type=topic,
        default=TRANSFORMS_TOPIC,
        metavar="/TOPIC",
        help="topic of the transforms; the static ones have _static appended (default: %(default)s)",
    )


def _fleet_of(robot: argparse.ArgumentParser) -> None:
    host = socket.gethostname().partition(".")[0]
    robot.add_argument(
        "--robot", type=fleet_name, default=host, metavar="NAME", help="name of the robot (default: %(default)s)"
    )
    _add_reach(robot, "accept connections there, instead of a router's")
    robot.add_argument(
        "--rate",
        type=_rate_or_all,
        default=RATE_HZ,
        metavar="HZ",
        help='largest number of messages per second of each topic, "all" for no limit; every warning is sent '
        "(default: %(default)g)",
    )
    robot.add_argument(
        "--topics",
        nargs="+",
        choices=tuple(TOPICS),
        metavar="WORD",
        help=f"publish only these topics, of {', '.join(TOPICS)}; warning and status are always published "
        "(default: all)",
    )


def add_fleet(fleet: argparse.ArgumentParser) -> None:
    """Add the arguments of the command ``fleet``."""
    _add_reach(fleet, "be the router that robots connect to")
    how = fleet.add_mutually_exclusive_group()
    how.add_argument("--once", action="store_true", help="show the fleet once and exit")
    how.add_argument(
        "--page",
        type=parse_listen,
        nargs="?",
        const=DEFAULT_LISTEN,
        metavar="HOST:PORT",
        help=f"serve it to browsers instead; prints the address of the page (default: {DEFAULT_LISTEN})",
    )
    fleet.add_argument("--json", action="store_true", help="print the fleet as JSON, once a second")
    fleet.add_argument(
        "--robots",
        type=fleet_name,
        nargs="+",
        default=[],
        metavar="NAME",
        help="list these robots first, even before they are heard; no other robot displaces them",
    )


def _add_reach(command: argparse.ArgumentParser, listening: str) -> None:
    command.add_argument(
        "--fleet", type=fleet_name, default=FLEET, metavar="NAME", help="name of the fleet (default: %(default)s)"
    )
    command.add_argument(
        "--connect",
        type=_endpoint,
        action="append",
        default=[],
        metavar="ENDPOINT",
        help=f"connect to a Zenoh router there, e.g. {ENDPOINT}; may be repeated",
    )
    command.add_argument(
        "--listen",
        type=_endpoint,
        action="append",
        default=[],
        metavar="ENDPOINT",
        help=f"{listening}, e.g. tcp/0.0.0.0:7447",
    )
    command.add_argument(
        "--zenoh-config",
        type=Path,
        metavar="FILE",
        help="configuration of Zenoh (JSON5), for TLS and access control; --connect and --listen outrank it",
    )


def _endpoint(text: str) -> str:
    """Return an endpoint of Zenoh, which itself waits for ever for one that can never be reached."""
    found = _ON_NETWORK.fullmatch(text)
    if not (found and int(found["port"]) <= 65535) and not _ON_MACHINE.fullmatch(text):
        raise argparse.ArgumentTypeError(
            f"must be like {ENDPOINT}, with one of tcp, udp, tls, quic and ws, or like unixsock-stream/PATH, "
            f"got {text!r:.80}"
        )
    return text


def _rate_or_all(text: str) -> float | None:
    return None if text == "all" else rate_hz(text)
