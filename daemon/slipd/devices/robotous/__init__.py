"""Robotous RFT force/torque sensors on a serial line. Sources: see `robotous_packets` and `robotous_session`."""

from __future__ import annotations

from slipd.devices import Device, RateOption
from slipd.devices.robotous.robotous_decoder import Decoder
from slipd.devices.robotous.robotous_packets import RESPONSE_LENGTH
from slipd.devices.robotous.robotous_session import RATES_HZ, Session

__all__ = ["DEVICE", "Decoder", "Session"]

DEVICE = Device(
    "robotous",
    "wrench",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(min(RATES_HZ), max(RATES_HZ)),
    baud=115_200,
    frame_bytes=RESPONSE_LENGTH,
    rate_option=RateOption("output_hz"),
    frame="a Robotous packet",
    evidence="maker",
)
