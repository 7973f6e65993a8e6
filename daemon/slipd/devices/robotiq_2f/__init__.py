"""Robotiq 2F-85, 2F-140 and Hand-E grippers; slipd is the Modbus RTU master.

Three registers are written (commands), three are read (status). Nothing moves without a permit: the session polls, and
sends a command only when `Session.execute` receives a permit. Positions, speeds and forces are bytes; tables in the
config convert them to metres and newtons. Source: Robotiq 2F instruction manual, control over Modbus RTU.
"""

from __future__ import annotations

from slipd.devices import Device, GripRange, Need, RateOption
from slipd.devices.robotiq_2f.robotiq_line import COMMAND_PAUSE_NS
from slipd.devices.robotiq_2f.robotiq_registers import Decoder
from slipd.devices.robotiq_2f.robotiq_session import Session

__all__ = ["DEVICE", "Decoder", "Session"]

GRIP = GripRange(force_n=235.0, stroke_m=0.140, speed_mps=0.250)
"""Force of a 2F-85, stroke and speed of a 2F-140."""

DEVICE = Device(
    "robotiq_2f",
    "gripper",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(1.0, 1e9 / COMMAND_PAUSE_NS),
    baud=115_200,
    needs_tables=True,
    grip=GRIP,
    needs=(
        Need(
            "force_table",
            "[[0, 20.0], [255, 185.0]]",
            "force byte, N on one pad, with a load cell between the pads; the maker publishes no table",
        ),
        Need(
            "width_table",
            "[[0.0118, 0.085], [0.902, 0.0]]",
            "position byte / 255 (a 2F-85: 3 to 230), m between the pads, with your fingertips",
        ),
    ),
    rate_option=RateOption("poll_period_s", 1.0),
    frame="a reply of a Robotiq gripper",
    evidence="driver",
)
