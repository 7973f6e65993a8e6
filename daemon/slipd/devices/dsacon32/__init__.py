"""Weiss DSACON32m, the tactile controller of the Schunk SDH hand: several matrices on one serial or TCP line.

The session asks the controller for its type and its matrices. The controller then streams images of all matrices, plain
or run-length encoded. Source: both Schunk libraries of the SDH hand.
"""

from __future__ import annotations

from slipd.devices import Device, RateOption
from slipd.devices.dsacon32.dsacon32_decoder import Decoder, encode_frame
from slipd.devices.dsacon32.dsacon32_session import MAX_RATE_HZ, Session

__all__ = ["DEVICE", "Decoder", "Session", "encode_frame"]

DEVICE = Device(
    "dsacon32",
    "tactile",
    ("serial", "tcp"),
    Decoder,
    Session,
    rates_hz=(1.0, MAX_RATE_HZ),
    baud=115_200,
    axes=1,
    shared=True,
    clock_span_ns=(1 << 32) * 1_000_000,
    rate_option=RateOption("rate_hz"),
    frame="a DSACON32m packet",
    evidence="maker",
)
