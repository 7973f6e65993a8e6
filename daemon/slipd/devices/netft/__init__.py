"""ATI Net F/T and Ethernet Axia force/torque sensors (also Schunk FTN-Axia): RDT records over UDP.

The session first requests the calibration, which is the value of one count, over TCP or from the sensor's web page.
Source: ATI Ethernet Axia manual.
"""

from __future__ import annotations

from slipd.devices import Device
from slipd.devices.netft.netft_decoder import Decoder
from slipd.devices.netft.netft_session import Session, inquiry

__all__ = ["DEVICE", "Decoder", "Session", "inquiry"]

FASTEST_HZ = 7912.0
"""Highest output rate in the manual."""

DEVICE = Device(
    "netft",
    "wrench",
    ("udp",),
    Decoder,
    Session,
    rates_hz=(1.0, FASTEST_HZ),
    inquiry=inquiry,
    frame="a record of a Net F/T",
    evidence="driver",
)
