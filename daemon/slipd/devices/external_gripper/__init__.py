"""Gripper behind an external driver: the daemon sends set-points to the driver and checks its answers.

This is for labs with a driver of their own. One driver is connected at a time; it registers, reports the state of its
gripper continuously, and answers every set-point. docs/devices.md describes the format.
"""

from __future__ import annotations

from slipd.devices import Device
from slipd.devices.external_gripper.external_gripper_message import Decoder
from slipd.devices.external_gripper.external_gripper_session import Session

__all__ = ["DEVICE", "Decoder", "Session"]

DEVICE = Device(
    "external_gripper",
    "gripper",
    ("local",),
    Decoder,
    Session,
    rates_hz=(1.0, 1000.0),
    frame="a message of a gripper's driver",
    evidence="own",
)
