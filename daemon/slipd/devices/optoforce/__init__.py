"""OptoForce and OnRobot HEX and OMD force(/torque) sensors: on the serial line, or behind their Ethernet converter.

A serial DAQ sends frames of one three-axis sensor, one six-axis sensor, or four three-axis sensors; the converter sends
RDT records over UDP. Source: OptoForce General DAQ and Ethernet converter manuals.
"""

from __future__ import annotations

from typing import Any

from slipd.devices import Device, Need, RateOption
from slipd.devices.optoforce import optoforce_frames as frames
from slipd.devices.optoforce.optoforce_frames import Decoder
from slipd.devices.shared import rdt_records as rdt
from slipd.devices.shared.device_interface import check_choice, check_integer
from slipd.devices.shared.sensor_session import SensorSession, Step, strip_padding

__all__ = ["DEVICE", "Decoder", "Session"]


FILTERS_HZ = (0, 500, 150, 50, 15, 5, 1.5)
"""Cut-off frequency of each filter code; code 0 is no filter."""
SERIAL_PERIODS_MS = (1, 3, 10, 33, 100)
"""Periods that the serial DAQ documents, 1000 to 10 Hz."""
LONGEST_UDP_PERIOD_MS = 255

UDP_FILTER, UDP_PERIOD = 0x0081, 0x0082


class Session(SensorSession[Decoder]):
    """Set rate and filter, start the readings, and repeat this whenever they fall silent; never tare.

    `state` is as in `StartupSequence`, such as "no answer to configuration".
    `identity` is the serial number of a serial DAQ; the converter does not report one.

    Args:
        wiring: See `Decoder`.
        period_ms: Time from one reading to the next: 1, 3, 10, 33 or 100 on a serial line, 1 to 255 over UDP.
        filter_hz: Cut-off frequency of the sensor's filter: 500, 150, 50, 15, 5, 1.5, or 0 for no filter.
        reading: The other options of `Decoder`.

    Raises:
        ValueError: An option is out of range or unknown.
    """

    def __init__(self, wiring: str = "serial", period_ms: int = 1, filter_hz: float = 150.0, **reading: Any) -> None:
        decoder = Decoder(wiring, **reading)
        check_choice("filter_hz", filter_hz, FILTERS_HZ)
        filter_code = FILTERS_HZ.index(filter_hz)
        if wiring == "serial":
            check_choice("period_ms", period_ms, SERIAL_PERIODS_MS)
            steps = [
                Step(
                    "configuration",
                    frames.encode_configuration(period_ms, filter_code),
                    reply=frames.ACK,
                    handle=lambda body: f"refused configuration: code {body[0]}" if body[0] else "",
                ),
                Step(
                    "serial number",
                    frames.GET_SERIAL_NUMBER,
                    "optional",
                    reply=frames.SERIAL_NUMBER,
                    handle=self._read_serial,
                ),
            ]
            stop = frames.encode_configuration(0, filter_code)
        else:
            check_integer("period_ms", period_ms, 1, LONGEST_UDP_PERIOD_MS)
            steps = [
                Step("rate", rdt.encode_request(UDP_PERIOD, period_ms), "none"),
                Step("filter", rdt.encode_request(UDP_FILTER, filter_code), "none"),
                Step("start", rdt.encode_request(rdt.START), "none"),
            ]
            stop = rdt.encode_request(rdt.STOP)
        super().__init__(decoder, steps, stop)

    def _read_serial(self, body: bytes) -> None:
        serial = strip_padding(body)
        self.identity = f"S/N {serial}" if serial else ""


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
