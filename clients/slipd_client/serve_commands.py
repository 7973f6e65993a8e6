"""The commands of ``slipctl serve``, and ``slipctl fleet``; see `slipd_client.slipctl_parser`."""

from __future__ import annotations

import argparse
import re
import socket
from pathlib import Path

from slipd_client.arguments import (
    DEFAULT_LISTEN,
    Add,
    Command,
    argument,
    finite,
    fleet_name,
    matching,
    number_in,
    one_of,
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

_ON_NETWORK = re.compile(r"(tcp|udp|tls|quic|ws)/(\[[0-9A-Fa-f:.%]+\]|[^/:\[\]\s]+):(?P<port>\d{1,5})([?#]\S*)?")
_ON_MACHINE = re.compile(r"unixsock-stream/\S+")

ros_topic = matching(r"(/[A-Za-z_][A-Za-z0-9_]*)+", "be the full name of a topic, such as /arm/slipd")
"""Type of arguments that are topics of ROS."""

ros_frame = matching(r"[^/](?s:.*)", "be the name of a frame, without a leading slash")
"""Type of arguments that are frames of ROS."""


def zenoh_endpoint(text: str) -> str:
    """Return an endpoint of Zenoh, which itself waits for ever for one that can never be reached."""
    found = _ON_NETWORK.fullmatch(text)
    if not (found and int(found["port"]) <= 65535) and not _ON_MACHINE.fullmatch(text):
        raise argparse.ArgumentTypeError(
            f"must be like {ENDPOINT}, with one of tcp, udp, tls, quic and ws, or like unixsock-stream/PATH, "
            f"got {text!r:.80}"
        )
    return text


def rate_or_all(text: str) -> float | None:
    """Return a rate; None: all messages."""
    return None if text == "all" else rate_hz(text)


def _reach(listening: str) -> tuple[Add, ...]:
    """Return the arguments that say which processes a fleet's command reaches."""
    return (
        argument(
            "--fleet", type=fleet_name, default=FLEET, metavar="NAME", help="name of the fleet (default: %(default)s)"
        ),
        argument(
            "--connect",
            type=zenoh_endpoint,
            action="append",
            default=[],
            metavar="ENDPOINT",
            help=f"connect to a Zenoh router there, e.g. {ENDPOINT}; may be repeated",
        ),
        argument(
            "--listen",
            type=zenoh_endpoint,
            action="append",
            default=[],
            metavar="ENDPOINT",
            help=f"{listening}, e.g. tcp/0.0.0.0:7447",
        ),
        argument(
            "--zenoh-config",
            type=Path,
            metavar="FILE",
            help="configuration of Zenoh (JSON5), for TLS and access control; --connect and --listen outrank it",
        ),
    )


SERVE_COMMANDS = (
    Command("serve", "", "serve live messages to other programs, until Ctrl-C"),
    Command(
        "serve foxglove",
        "slipd_client.ros.foxglove_command:run",
        "serve Foxglove, Lichtblick and PlotJuggler over a WebSocket (docs/viewers.md)",
        (
            argument(
                "--listen",
                type=parse_listen,
                default=FOXGLOVE_LISTEN,
                metavar="HOST:PORT",
                help="where to serve (default: %(default)s; port 0: any free one); anyone who can reach it can read "
                "everything",
            ),
            argument(
                "--config",
                type=Path,
                metavar="FILE",
                help="config of the daemon: /tf gets the positions of its pads, and the layouts draw lines at its "
                "levels",
            ),
            argument("--write-layouts", type=Path, metavar="FOLDER", help="write layouts for these viewers and exit"),
            argument(
                "--fingers",
                nargs="+",
                type=matching("[a-z0-9]{1,32}", "be the name of a finger, a-z and 0-9"),
                default=["left", "right"],
                metavar="NAME",
                help="fingers of the layouts (default: left right)",
            ),
        ),
        given={"needs": {"foxglove": "foxglove-sdk"}},
    ),
    Command(
        "serve ros2",
        "slipd_client.ros.ros2_command:run",
        "publish ROS 2 topics, and take the arm's motion from ROS (docs/viewers.md)",
        (
            argument(
                "--config", type=Path, metavar="FILE", help="config of the daemon: /tf gets the positions of its pads"
            ),
            argument("--domain", metavar="ID", help="id of the DDS domain (default: ROS_DOMAIN_ID, or 0)"),
            argument(
                "--prefix",
                type=ros_topic,
                default=NAMESPACE,
                metavar="/NAME",
                help="beginning of the topics, in the place of %(default)s",
            ),
            argument(
                "--wrench-rate",
                type=rate_hz,
                metavar="HZ",
                help="largest number of wrenches per second of each finger; others are left out (default: all)",
            ),
            argument(
                "--hand",
                type=ros_frame,
                metavar="FRAME",
                help="frame of the robot that coincides with the gripper's frame of the config: /tf_static joins them",
            ),
            one_of(
                argument(
                    "--orientation-from",
                    type=ros_frame,
                    metavar="FRAME",
                    help="send the daemon the motion of --hand in this frame, whose Z points up, by the transforms: "
                    "the stream [grasp.arm] of the config, or the orientation without it; needs --config",
                ),
                argument(
                    "--imu",
                    type=ros_topic,
                    metavar="/TOPIC",
                    help="send the daemon the motion, or the orientation, by this sensor_msgs/Imu on the gripper; "
                    "needs --config",
                ),
            ),
            argument(
                "--imu-mount",
                nargs=4,
                type=finite,
                metavar=("X", "Y", "Z", "W"),
                help="orientation of the IMU in the gripper's frame, unit quaternion (default: 0 0 0 1)",
            ),
            argument(
                "--imu-at",
                nargs=3,
                type=finite,
                metavar=("X", "Y", "Z"),
                help="place of the IMU in the gripper's frame, m, for the stream [grasp.arm] (default: 0 0 0)",
            ),
            argument(
                "--speed-scaling",
                type=ros_topic,
                metavar="/TOPIC",
                help="publish how fast the arm may go as control_msgs/SpeedScalingFactor, e.g. on "
                "/joint_trajectory_controller/speed_scaling_input; needs --speed-floor",
            ),
            argument(
                "--speed-floor",
                type=number_in("from 0 to less than 1", lambda factor: 0.0 <= factor < 1.0),
                metavar="FACTOR",
                help="factor while the speed that holds is not known, from 0 (the arm pauses) to less than 1",
            ),
            argument(
                "--check-plans",
                type=ros_topic,
                metavar="/TOPIC",
                help="answer every trajectory_msgs/MultiDOFJointTrajectory of the gripper with a "
                "slipd_msgs/MotionCheck on PREFIX/motion_check: does the grip hold it?",
            ),
            argument(
                "--plan-frame",
                type=ros_frame,
                metavar="FRAME",
                help="frame of their poses, whose Z points up (default: that of --orientation-from)",
            ),
            argument(
                "--tf-topic",
                type=ros_topic,
                default=TRANSFORMS_TOPIC,
                metavar="/TOPIC",
                help="topic of the transforms; the static ones have _static appended (default: %(default)s)",
            ),
        ),
        given={"needs": {"cyclonedds": "cyclonedds"}},
    ),
    Command(
        "serve fleet",
        "slipd_client.fleet.robot_bridge:run",
        "publish the messages of this robot to its fleet over Zenoh (docs/fleet.md)",
        (
            argument(
                "--robot",
                type=fleet_name,
                default=socket.gethostname().partition(".")[0],
                metavar="NAME",
                help="name of the robot (default: %(default)s)",
            ),
            *_reach("accept connections there, instead of a router's"),
            argument(
                "--rate",
                type=rate_or_all,
                default=RATE_HZ,
                metavar="HZ",
                help='largest number of messages per second of each topic, "all" for no limit; every warning is sent '
                "(default: %(default)g)",
            ),
            argument(
                "--topics",
                nargs="+",
                choices=tuple(TOPICS),
                metavar="WORD",
                help=f"publish only these topics, of {', '.join(TOPICS)}; warning and status are always published "
                "(default: all)",
            ),
        ),
        given={"needs": {"zenoh": "eclipse-zenoh"}},
    ),
    Command(
        "fleet",
        "slipd_client.fleet.fleet_command:run",
        "show level, health and age of every robot of a fleet (docs/fleet.md)",
        (
            *_reach("be the router that robots connect to"),
            one_of(
                argument("--once", action="store_true", help="show the fleet once and exit"),
                argument(
                    "--page",
                    type=parse_listen,
                    nargs="?",
                    const=DEFAULT_LISTEN,
                    metavar="HOST:PORT",
                    help=f"serve it to browsers instead; prints the address of the page (default: {DEFAULT_LISTEN})",
                ),
            ),
            argument("--json", action="store_true", help="print the fleet as JSON, once a second"),
            argument(
                "--robots",
                type=fleet_name,
                nargs="+",
                default=[],
                metavar="NAME",
                help="list these robots first, even before they are heard; no other robot displaces them",
            ),
        ),
        given={"needs": {"zenoh": "eclipse-zenoh"}},
    ),
)
