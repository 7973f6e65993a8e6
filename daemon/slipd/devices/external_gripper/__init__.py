"""A gripper that another driver holds: the daemon sends set-points to that driver, and believes its answers or not.

For labs whose own driver speaks to the gripper. One driver is connected at a time; it registers, reports the state of
its gripper all the time, and answers every set-point. The format is written down in docs/devices.md.
"""

from __future__ import annotations

from slipd.devices import Device
from slipd.devices.external_gripper.external_gripper_decoder import Decoder
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
)
