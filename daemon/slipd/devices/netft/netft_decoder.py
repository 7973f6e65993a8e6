"""Decoder of the RDT records of a Net F/T sensor, and the meaning of their status bits."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from slipd.devices.netft import netft_calibration
from slipd.devices.netft.netft_calibration import Calibration
from slipd.devices.shared import rdt_records as rdt
from slipd.devices.shared.decoder_health import DecoderHealth
from slipd.types.arrays import Array
from slipd.types.samples import WrenchSample

INTERNAL_HZ = 7000.0

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


class Decoder:
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
        internal_hz: Rate of the sensor's sample counter, Hz; 0 if it gives no time.

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
        self.health = DecoderHealth()
        calibration = netft_calibration.from_counts(counts_per_force, counts_per_torque, force_unit, torque_unit)
        self._internal_hz = netft_calibration.checked_hz("internal_hz", internal_hz)
        self._records = rdt.RecordScanner(self.health, _RESERVED)
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

    def forget(self) -> None:
        """Drop a partial record, and expect the first record of a freshly opened stream."""
        self._records.forget()

    def receive(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        """Decode bytes received at ``t_ns``; return the readings they complete, in the sensor's frame."""
        heads, counts = self._records.receive(data)
        if self._per_count is None:
            self.health.bad += len(heads)
            return []
        if heads:
            self.health.warning = MONITOR if heads[-1][1] >> 16 & 1 else self._warning
        values = (counts * self._per_count).tolist()
        tick_ns = 1e9 / self._internal_hz if self._internal_hz else 0.0
        samples = [
            WrenchSample(
                t_ns,
                round(ticks * tick_ns) if tick_ns else None,
                row[:3],
                row[3:],
                _status_names(status) if status else (),
            )
            for (ticks, status), row in zip(heads, values, strict=True)
        ]
        self.health.good += len(samples)
        return samples


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
