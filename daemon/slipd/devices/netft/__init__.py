"""ATI Net F/T and Ethernet Axia force/torque sensors (also Schunk FTN-Axia): RDT records over UDP.

Records that are lost or come out of order: `slipd.devices.shared.rdt_records`, which other devices share.

The session first requests the calibration, which is the value of one count, over TCP or from the sensor's web page.
Source: ATI Ethernet Axia manual, table 4.7 (status bits). Classic Net F/T boxes: pyNetFT (netft/pyNetFT,
``classify_status``), where 0x80010000 is a warning and every other status but 0 an error. The output rate is a setting
of the sensor, which slipd changes only where the option ``output_hz`` is given.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from slipd.devices import Device, Inquiry, RateOption
from slipd.devices.netft import netft_calibration
from slipd.devices.netft.netft_calibration import (
    FASTEST_HZ,
    INTERNAL_HZ,
    Calibration,
    checked_output_hz,
    needed_change,
    rate_fault,
)
from slipd.devices.shared import rdt_records as rdt
from slipd.devices.shared.device_interface import check_choice
from slipd.devices.shared.frame_scanner import FrameDecoder
from slipd.devices.shared.sensor_session import SensorSession, Step
from slipd.types.arrays import Array
from slipd.types.samples import Sample, WrenchSample

_BIT_NAMES = {
    0: ("temperature",),
    1: ("supply",),
    2: ("broken_gauge", "invalid"),
    3: ("busy",),
    5: ("other_error", "invalid"),
    7: ("no_calibration", "invalid"),
    16: ("monitor",),
    27: ("gauge_range", "overload"),
    28: ("simulated",),
    29: ("calibration_checksum", "invalid"),
    30: ("overload",),
}
_ANY_ERROR = 1 << 31
_LATCHED = _ANY_ERROR | 1 << 16
"""Status of a classic Net F/T box whose only finding is a latched monitor condition. An Axia never sends it: there the
condition is no error."""
_ERRORS = sum(1 << bit for bit in (0, 1, 2, 5, 7, 27, 29, 30))
MONITOR = "a monitor condition is latched in the sensor (Thresholding on its web page); its readings count"
_RESERVED = ~(sum(1 << bit for bit in _BIT_NAMES) | _ANY_ERROR) & 0xFFFF_FFFF


class Decoder(FrameDecoder):
    """Decode records, one or many per datagram, to wrench samples.

    ``device_time_ns`` is the sensor's sample counter, unwrapped, at its nominal rate. `health.lost` counts the gaps in
    the record number, which starts again with every start.

    Status names: "temperature", "supply" (outside the sensor's limits), "busy" (settings change), "monitor" (a
    condition latched), "simulated"; "overload" (force or torque out of range, or a count at the end of its range), with
    "gauge_range" if a gauge is; "invalid" with "broken_gauge", "other_error", "no_calibration" or
    "calibration_checksum". "unknown" is a reserved bit; "error" is the bit for any error, and makes a reading "invalid"
    if no known error explains it. The names are those of the Axia. On a classic Net F/T box the other bits stand for
    faults of boards, links and memory: with the error bit they are "invalid" or "overload" all the same, except for a
    latched monitor condition, which is a warning only (`health.warning`).

    Args:
        counts_per_force: Counts per ``force_unit``.
        counts_per_torque: Counts per ``torque_unit``.
        force_unit: "lbf", "N", "klbf", "kN", "kgf" or "gf".
        torque_unit: "lbf-in", "lbf-ft", "N-m", "N-mm", "kgf-cm" or "kN-m".
        internal_hz: Rate of the sensor's sample counter, Hz; 0 if it gives no time. A rate on the web page takes
            precedence.

    Raises:
        ValueError: A number is out of range or a unit is unknown.
    """

    def __init__(
        self,
        counts_per_force: float = 1_000_000.0,
        counts_per_torque: float = 1_000_000.0,
        force_unit: str = "N",
        torque_unit: str = "N-m",
        internal_hz: float = INTERNAL_HZ,
    ) -> None:
        super().__init__()
        calibration = netft_calibration.from_counts(counts_per_force, counts_per_torque, force_unit, torque_unit)
        self._internal_hz = netft_calibration.checked_hz("internal_hz", internal_hz)
        self._frames: rdt.RecordScanner = rdt.RecordScanner(self.health, _RESERVED)
        self._per_count: Array | None = None
        self._warning = ""
        self.calibrate(calibration)

    def calibrate(self, calibration: Calibration | None, warning: str = "") -> None:
        """Set the value of a count, and what is wrong with the sensor's settings.

        Args:
            calibration: None if it is unknown; records are counted as bad then.
            warning: Shown while the records report nothing more urgent.
        """
        self._per_count = None
        self._warning = warning
        if calibration is not None:
            self._per_count = np.repeat((calibration.force_n, calibration.torque_nm), 3)
            if self._internal_hz and calibration.internal_hz:
                self._internal_hz = calibration.internal_hz

    def _readings(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        heads, counts = self._frames.records(data)
        if self._per_count is None:
            self.health.bad += len(heads)
            return []
        if heads:
            self.health.warning = MONITOR if heads[-1][1] >> 16 & 1 else self._warning
        values = (counts * self._per_count).tolist()
        tick_ns = 1e9 / self._internal_hz if self._internal_hz else 0.0
        return [
            WrenchSample(
                t_ns,
                round(ticks * tick_ns) if tick_ns else None,
                row[:3],
                row[3:],
                _status_names(status) if status else (),
            )
            for (ticks, status), row in zip(heads, values, strict=True)
        ]


@lru_cache(maxsize=64)  # a condition lasts for many records, and few exist at a time
def _status_names(status: int) -> tuple[str, ...]:
    names = [name for bit, of_bit in _BIT_NAMES.items() if status >> bit & 1 for name in of_bit]
    if status == _LATCHED:
        return ("monitor",)
    if status & rdt.AT_RAIL:
        names.append("overload")
    if status & _RESERVED:
        names.append("unknown")
    if status & _ANY_ERROR:
        names.append("error")
        if not status & _ERRORS:
            names.append("invalid")
    return tuple(dict.fromkeys(names))


_INQUIRIES = {"tcp": netft_calibration.TCP_INQUIRY, "xml": netft_calibration.XML_INQUIRY, "config": None}


class Session(SensorSession[Decoder]):
    """Receive the calibration, start the records, and start them again whenever they fall silent.

    The answer to the inquiry is the first data on the link; the transport repeats an inquiry until `Inquiry.check`
    accepts the answer. No reading is returned before the calibration is known. `state` is "closed",
    "waiting for calibration", "wrong calibration: …", "waiting" (for records), "running" or "no answer to start".

    Args:
        calibration: "tcp" (requested over TCP, port 49151), "xml" (read from the sensor's web page) or "config" (the
            numbers and units given here, which are ignored otherwise).
        buffered: Let the sensor send several records per datagram, as its RDT buffer size says: fewer wake-ups, later
            readings.
        output_hz: Output rate that slipd sets on the sensor, Hz, where its web page reports another one; the sensor
            stores it, and rounds it up to its clock divided by a whole number. It needs "xml". 0 leaves the sensor as
            it is set.
        counts: The options of `Decoder`.

    Raises:
        ValueError: An option is out of range or unknown.
    """

    def __init__(self, calibration: str = "tcp", buffered: bool = True, output_hz: int = 0, **counts: Any) -> None:
        self._has_inquiry = inquiry(calibration) is not None
        self._output_hz = checked_output_hz(output_hz, calibration)
        self._read = netft_calibration.read_tcp if calibration == "tcp" else netft_calibration.read_xml
        start = Step("start", rdt.encode_request(rdt.START_BUFFERED if buffered else rdt.START), "none")
        super().__init__(Decoder(**counts), [start], rdt.encode_request(rdt.STOP))
        self._answer: bytes | None = None  # the part received so far; None if no answer is awaited
        if self._has_inquiry:
            self.decoder.calibrate(None)

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link: wait for the calibration, or start the records."""
        if not self._has_inquiry:
            return super().start(now_ns)
        self.stop()
        self.identity, self._answer = "", b""
        self.decoder.calibrate(None)
        self.state = "waiting for calibration"
        return b""

    def receive(self, data: bytes, now_ns: int) -> Sequence[Sample]:
        """Decode bytes received at ``now_ns``; return the readings they complete."""
        if self._answer is not None:
            self._handle_answer(self._answer + data, now_ns)
            return []
        return super().receive(data, now_ns)

    def on_time(self, now_ns: int) -> bytes:
        """Return the request that is due at ``now_ns``; empty if none is."""
        if request := super().on_time(now_ns):
            self.decoder.forget()
        return request

    def stop(self) -> bytes:
        """End; return the request that stops the records."""
        self._answer = None
        return super().stop()

    def _handle_answer(self, answer: bytes, now_ns: int) -> None:
        calibration = self._read(answer)
        self._answer = answer if calibration is None else None
        if isinstance(calibration, str):
            self.health.bad += 1
            self.health.bad_bytes += len(answer)
            self.state = f"wrong calibration: {calibration}"
        elif calibration is not None:
            self.decoder.calibrate(calibration, rate_fault(self._output_hz, calibration))
            self.identity = calibration.identity
            self.begin(now_ns)


def inquiry(calibration: str = "tcp", output_hz: int = 0, **_others: Any) -> Inquiry | None:
    """Return the inquiry to send over TCP before the link is up, for the options of `Session`; None for none.

    Raises:
        ValueError: The calibration is not "tcp", "xml" or "config".
    """
    check_choice("calibration", calibration, _INQUIRIES)
    found = _INQUIRIES[calibration]
    return replace(found, change=partial(needed_change, output_hz)) if found is not None and output_hz else found


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
