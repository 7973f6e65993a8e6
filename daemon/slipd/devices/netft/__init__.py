"""ATI Net F/T and Ethernet Axia force/torque sensors (also Schunk FTN-Axia): RDT records over UDP.

Records that are lost or come out of order: `slipd.devices.shared.rdt_records`, which other devices share.

The session first requests the calibration, which is the value of one count, over TCP or from the sensor's web page.
Source: ATI Ethernet Axia manual, table 4.7 (status bits). Classic Net F/T boxes: pyNetFT (netft/pyNetFT,
``classify_status``), where 0x80010000 is a warning and every other status but 0 an error. The output rate is a setting
of the sensor, which slipd changes only where the option ``output_hz`` is given (`netft_output_rate`).
"""

from __future__ import annotations

from slipd.devices import Device, RateOption
from slipd.devices.netft.netft_calibration import FASTEST_HZ
from slipd.devices.netft.netft_session import Decoder, Session, inquiry

__all__ = ["DEVICE", "Decoder", "Session", "inquiry"]

DEVICE = Device(
    "netft",
    "wrench",
    ("udp",),
    Decoder,
    Session,
    rates_hz=(1.0, float(FASTEST_HZ)),
    rate_option=RateOption("output_hz"),
    rate_hint="set RDT Output Rate on the sensor's web page (comm.htm), or options.output_hz or rate_hz in the config",
    inquiry=inquiry,
    frame="a record of a Net F/T",
    evidence="driver",
)
