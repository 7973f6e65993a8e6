"""Weiss and Schunk WSG grippers over TCP, in their binary command protocol.

The gripper sends width, force and state periodically, and answers one command at a time. Nothing moves without a
permit. A grip is a pre-position to a width narrower than the part, which clamps what blocks the way. Unlike the
gripper's own "grasp", it may be repeated while something is held, it never ends by itself, and it opens only if the
goal is wider than the present width. To change the force, the session sets the limit and repeats the goal of the grip;
if the goal is unknown, as after a stop, it sets only the limit.
"""

from __future__ import annotations

from slipd.devices import Device, GripRange, RateOption
from slipd.devices.wsg.wsg_decoder import Decoder
from slipd.devices.wsg.wsg_session import LONGEST_MS, SHORTEST_MS, Session

__all__ = ["DEVICE", "Decoder", "Session"]

GRIP = GripRange(force_n=60.0, stroke_m=0.210, speed_mps=0.420)
"""Force on one pad: half of the 120 N of a WSG 50 in overdrive. Stroke of a WSG 50-210."""

DEVICE = Device(
    "wsg",
    "gripper",
    ("tcp",),
    Decoder,
    Session,
    rates_hz=(1000.0 / LONGEST_MS, 1000.0 / SHORTEST_MS),
    grip=GRIP,
    rate_option=RateOption("period_ms", 1000.0),
    frame="a WSG packet",
    evidence="driver",
)
