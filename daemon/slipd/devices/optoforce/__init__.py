"""OptoForce and OnRobot HEX and OMD force(/torque) sensors: on the serial line, or behind their Ethernet converter.

A serial DAQ sends frames of one three-axis sensor, one six-axis sensor, or four three-axis sensors; the converter sends
RDT records over UDP. Source: OptoForce General DAQ and Ethernet converter manuals.
"""

from __future__ import annotations

from slipd.devices import Device, Need, RateOption
from slipd.devices.optoforce.optoforce_decoder import Decoder
from slipd.devices.optoforce.optoforce_session import LONGEST_UDP_PERIOD_MS, Session

__all__ = ["DEVICE", "Decoder", "Session"]

DEVICE = Device(
    "optoforce",
    "wrench",
    ("serial", "udp"),
    Decoder,
    Session,
    rates_hz=(1000.0 / LONGEST_UDP_PERIOD_MS, 1000.0),
    baud=1_000_000,
    needs_wiring=True,
    needs=(
        Need(
            "options.counts_per_n",
            "[1.0, 1.0, 1.0]",
            "counts at nominal load / nominal load of x y z, from the sensitivity report that comes with the sensor; "
            "with 1, readings are counts, not newtons",
            transports=("serial",),
            scales=True,
        ),
        Need(
            "options.counts_per_nm",
            "[1.0, 1.0, 1.0]",
            "likewise, of the torques; a three-axis sensor has none",
            transports=("serial",),
        ),
    ),
    rate_option=RateOption("period_ms", 1000.0),
    frame="an OptoForce frame",
    evidence="capture",
)
