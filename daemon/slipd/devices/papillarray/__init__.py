"""Contactile PapillArray pads behind a PTS controller: nine three-axis pillars per sensor, two sensors per port.

The controller streams without a request; the session only sets its rate. It never sends the command that zeroes the
sensors, because slipd's own tares are reversible. Sources: see `papillarray_frames`.
"""

from __future__ import annotations

from slipd.devices import Device, RateOption
from slipd.devices.papillarray.papillarray_decoder import Decoder
from slipd.devices.papillarray.papillarray_frames import PILLARS, SENSORS
from slipd.devices.papillarray.papillarray_session import RATES_HZ, Session

__all__ = ["DEVICE", "Decoder", "Session"]

DEVICE = Device(
    "papillarray",
    "tactile",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(RATES_HZ[0], RATES_HZ[-1]),
    baud=115_200,
    axes=3,
    measures_newtons=True,
    taxels=PILLARS,
    shared=True,
    sensors=tuple(map(str, range(SENSORS))),
    rate_option=RateOption("rate_hz"),
    frame="a PTS frame",
    evidence="maker",
)
