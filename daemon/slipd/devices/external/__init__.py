"""Readings that another process sends: a driver that holds the port of a sensor, a camera, or what moves the arm.

Each reading is one msgpack map; docs/devices.md describes it.
"""

from __future__ import annotations

from slipd.devices import Device
from slipd.devices.external.external_decoder import MAX_STREAMS, Decoder
from slipd.devices.external.external_message import MAX_MESSAGE, encode_reading

__all__ = ["DEVICE", "MAX_MESSAGE", "MAX_STREAMS", "Decoder", "encode_reading"]

FASTEST_HZ = 10_000.0
"""What one socket carries without a backlog, and more than any force sensor sends."""

DEVICE = Device(
    "external",
    "any",
    ("external",),
    Decoder,
    rates_hz=(0.1, FASTEST_HZ),
    shared=True,
    host_clock=True,
    frame="a reading",
    evidence="own",
)
