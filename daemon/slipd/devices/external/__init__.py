"""Readings that another process sends: for labs whose own driver holds the port of a sensor.

Each message is one msgpack map, `{stream, t_ns, force_n, torque_nm}`, `{stream, t_ns, values}` or
`{stream, t_ns, object_pose, object_speed_mps}`; docs/devices.md describes it. Messages are self-delimiting, so no
transport needs to deliver them one by one.
"""

from __future__ import annotations

from slipd.devices import Device
from slipd.devices.external.external_decoder import Decoder
from slipd.devices.external.external_message import encode_reading

__all__ = ["DEVICE", "Decoder", "encode_reading"]

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
