"""Bota Systems Rokubi, SensONE and MiniONE force/torque sensors on a serial line (binary format).

The sensor boots with a text banner, is configured by short text commands, and then streams 37-byte frames.
Acknowledgements and the banner travel in the same stream as the frames. Source: Bota serial example and driver.
"""

from __future__ import annotations

from slipd.devices import Device, RateOption
from slipd.devices.bota.bota_decoder import FRAME_LENGTH, US_SPAN, Decoder, encode_frame
from slipd.devices.bota.bota_session import SAMPLES_HZ, SINC_LENGTHS, Session

__all__ = ["DEVICE", "Decoder", "Session", "encode_frame"]

DEVICE = Device(
    "bota",
    "wrench",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(SAMPLES_HZ / SINC_LENGTHS[1], SAMPLES_HZ / SINC_LENGTHS[0]),
    baud=460_800,
    frame_bytes=FRAME_LENGTH,
    clock_span_ns=US_SPAN * 1_000,
    rate_option=RateOption("sinc_length", SAMPLES_HZ),
    frame="a Bota frame",
    evidence="maker",
)
