"""ATI Net F/T and Ethernet Axia force/torque sensors (also Schunk FTN-Axia): RDT records over UDP.

What a count is worth is asked of the sensor first, over TCP or from its web page. Source: ATI Ethernet Axia manual.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from slipd.devices import Device, Inquiry, netft_calibration, rdt
from slipd.devices.conversation import RETRY_PAUSE_NS, Conversation, Step
from slipd.devices.health import DecoderHealth
from slipd.devices.netft_calibration import Calibration
from slipd.samples import Array, WrenchSample

INTERNAL_HZ = 7000.0

_INQUIRIES = {"tcp": netft_calibration.TCP_INQUIRY, "xml": netft_calibration.XML_INQUIRY, "config": None}

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
_ERRORS = sum(1 << bit for bit in (0, 1, 2, 5, 7, 27, 29, 30))
_RESERVED = ~(sum(1 << bit for bit in _BIT_NAMES) | _ANY_ERROR) & 0xFFFF_FFFF


class Decoder:
    """Makes wrench samples of the records, one or many a datagram.

    ``device_time_ns`` is the sensor's sample counter at its nominal rate, unwrapped. `health.lost` counts the gaps of
    the record number, which begins anew with every start.

    Status names: "temperature", "supply" (outside the sensor's limits), "busy" (settings change), "monitor" (a
    condition latched), "simulated"; "overload" (force or torque out of range, or a count at the end of its range),
    with "gauge_range" when a gauge is; "invalid" with "broken_gauge", "other_error", "no_calibration" or
    "calibration_checksum". "unknown" is a reserved bit; "error" is the bit for any error, and makes a reading
    "invalid" when no known error explains it.

    Args:
        counts_per_force: Counts per ``force_unit``.
        counts_per_torque: Counts per ``torque_unit``.
        force_unit: "lbf", "N", "klbf", "kN", "kgf" or "gf".
        torque_unit: "lbf-in", "lbf-ft", "N-m", "N-mm", "kgf-cm" or "kN-m".
        internal_hz: Rate of the sensor's sample counter, Hz; 0: its records have no time.

    Raises:
        ValueError: A number is out of range or a unit is not known.
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
        calibration = netft_calibration.of_numbers(counts_per_force, counts_per_torque, force_unit, torque_unit)
        self._internal_hz = netft_calibration.checked_hz("internal_hz", internal_hz)
        self._records = rdt.Records(self.health, _RESERVED)
        self._per_count: Array | None = None
        self.calibrate(calibration)

    def calibrate(self, calibration: Calibration | None) -> None:
        """Take what a count is worth; None where it is not known (any more): records are then counted as bad."""
        self._per_count = None
        if calibration is not None:
            self._per_count = np.repeat((calibration.force_n, calibration.torque_nm), 3)
            if self._internal_hz and calibration.internal_hz:
                self._internal_hz = calibration.internal_hz

    def forget(self) -> None:
        """Drop a begun record, and expect the first one of a freshly opened stream."""
        self._records.forget()

    def receive(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        """Take bytes received at ``t_ns`` and return the readings they complete, in the sensor's frame."""
        heads, counts = self._records.receive(data)
        if self._per_count is None:
            self.health.bad += len(heads)
            return []
        values = (counts * self._per_count).tolist()
        tick_ns = 1e9 / self._internal_hz if self._internal_hz else 0.0
        samples = [
            WrenchSample(
                t_ns,
                round(ticks * tick_ns) if tick_ns else None,
                row[:3],
                row[3:],
                _words(status) if status else (),
            )
            for (ticks, status), row in zip(heads, values, strict=True)
        ]
        self.health.good += len(samples)
        return samples


@lru_cache(maxsize=64)  # a condition lasts many records, and few are there at a time
def _words(status: int) -> tuple[str, ...]:
    words = [word for bit, names in _BIT_NAMES.items() if status >> bit & 1 for word in names]
    if status & rdt.AT_RAIL:
        words.append("overload")
    if status & _RESERVED:
        words.append("unknown")
    if status & _ANY_ERROR:
        words.append("error")
        if not status & _ERRORS:
            words.append("invalid")
    return tuple(dict.fromkeys(words))


class Session:
    """Asks what a count is worth, starts the records, and starts them again whenever they fall silent.

    The answer to the inquiry is the link's first bytes. No reading is handed on before it is known. `state` is
    "closed", "waiting for calibration", "no calibration", "wrong calibration: …", "waiting" (for records), "running"
    or "no answer to start".

    Args:
        calibration: "tcp" (asked over TCP, port 49151), "xml" (read from the sensor's web page) or "config" (the
            numbers and units given here, which are not used otherwise).
        counts_per_force: As of `Decoder`.
        counts_per_torque: Likewise.
        force_unit: Likewise.
        torque_unit: Likewise.
        internal_hz: Likewise; the web page's own figure takes its place.
        buffered: Let the sensor send several records a datagram.

    Raises:
        ValueError: An option is out of range or not known.
    """

    def __init__(
        self,
        calibration: str = "tcp",
        counts_per_force: float = 1_000_000.0,
        counts_per_torque: float = 1_000_000.0,
        force_unit: str = "N",
        torque_unit: str = "N-m",
        internal_hz: float = INTERNAL_HZ,
        buffered: bool = True,
    ) -> None:
        self._asks = inquiry(calibration)
        self._read = netft_calibration.read_tcp if calibration == "tcp" else netft_calibration.read_xml
        self.decoder = Decoder(counts_per_force, counts_per_torque, force_unit, torque_unit, internal_hz)
        self.health = self.decoder.health
        self.identity = ""
        command = rdt.START_BUFFERED if buffered else rdt.START
        self._talk = Conversation([Step("start", rdt.encode_request(command), "none")])
        self._answer: bytes | None = None  # as far as it has come, while it is waited for
        self._trouble = ""
        self._trouble_due_ns = 0
        if self._asks:
            self.decoder.calibrate(None)

    @property
    def state(self) -> str:
        """A short word for people."""
        return self._trouble or self._talk.state

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link: by waiting for the calibration, or by starting the records."""
        if self._asks is None:
            self._talk.start(now_ns)
            return self.on_time(now_ns)
        self.identity, self._answer = "", b""
        self.decoder.calibrate(None)
        self._stand_still("waiting for calibration", now_ns)
        return b""

    def receive(self, data: bytes, now_ns: int) -> list[WrenchSample]:
        """Take bytes received at ``now_ns`` and return the readings they complete."""
        if self._answer is not None:
            self._take_answer(self._answer + data, now_ns)
            return []
        samples = self.decoder.receive(data, now_ns)
        if samples:
            self._talk.has_reading(now_ns)
        return samples

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None while closed."""
        return self._trouble_due_ns if self._trouble else self._talk.due_ns

    def on_time(self, now_ns: int) -> bytes:
        """Return the request that is due at ``now_ns``; empty when none is."""
        if not self._trouble:
            if request := self._talk.on_time(now_ns):
                self.decoder.forget()
            return request
        if now_ns >= self._trouble_due_ns:
            self._stand_still("no calibration" if self._answer is not None else self._trouble, now_ns)
        return b""

    def stop(self) -> bytes:
        """End, and return the request that stops the records."""
        self._talk.stop()
        self._answer, self._trouble = None, ""
        return rdt.encode_request(rdt.STOP)

    def _take_answer(self, answer: bytes, now_ns: int) -> None:
        calibration = self._read(answer)
        self._answer = answer if calibration is None else None
        if isinstance(calibration, str):
            self.health.bad += 1
            self.health.bad_bytes += len(answer)
            self._stand_still(f"wrong calibration: {calibration}", now_ns)
        elif calibration is not None:
            self.decoder.calibrate(calibration)
            self.identity = calibration.identity
            self._trouble = ""
            self._talk.start(now_ns)

    def _stand_still(self, trouble: str, now_ns: int) -> None:
        self._trouble, self._trouble_due_ns = trouble, now_ns + RETRY_PAUSE_NS


def inquiry(calibration: str = "tcp", **_others: Any) -> Inquiry | None:
    """Return what is asked over TCP before the link is up, given the options of `Session`; None for nothing.

    Raises:
        ValueError: The calibration is none of "tcp", "xml" and "config".
    """
    if calibration not in _INQUIRIES:
        raise ValueError(f"calibration {calibration!r} is not known: {', '.join(_INQUIRIES)} are")
    return _INQUIRIES[calibration]


FASTEST_HZ = 7912.0
"""The fastest output that the manual names."""

DEVICE = Device(
    "netft",
    "wrench",
    ("udp",),
    Decoder,
    Session,
    rates_hz=(1.0, FASTEST_HZ),
    inquiry=inquiry,
    frame="a record of a Net F/T",
)
