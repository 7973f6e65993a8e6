"""Session with a Net F/T sensor: receive its calibration, start its records, and restart them after silence."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from slipd.devices import Inquiry
from slipd.devices.netft import netft_calibration
from slipd.devices.netft.netft_decoder import INTERNAL_HZ, Decoder
from slipd.devices.netft.netft_output_rate import checked_output_hz, needed_change, rate_fault
from slipd.devices.shared import rdt_records as rdt
from slipd.devices.shared.startup_sequence import RETRY_PAUSE_NS, StartupSequence, Step
from slipd.types.samples import WrenchSample

_INQUIRIES = {"tcp": netft_calibration.TCP_INQUIRY, "xml": netft_calibration.XML_INQUIRY, "config": None}


class Session:
    """Receive the calibration, start the records, and start them again whenever they fall silent.

    The answer to the inquiry is the first data on the link. No reading is returned before it is known. `state` is
    "closed", "waiting for calibration", "no calibration", "wrong calibration: …", "waiting" (for records), "running" or
    "no answer to start".

    Args:
        calibration: "tcp" (requested over TCP, port 49151), "xml" (read from the sensor's web page) or "config" (the
            numbers and units given here, which are ignored otherwise).
        counts_per_force: See `Decoder`.
        counts_per_torque: See `Decoder`.
        force_unit: See `Decoder`.
        torque_unit: See `Decoder`.
        internal_hz: See `Decoder`; a rate on the web page takes precedence.
        buffered: Let the sensor send several records per datagram, as its RDT buffer size says: fewer wake-ups, later
            readings.
        output_hz: Output rate that slipd sets on the sensor, Hz, where its web page reports another one; the sensor
            stores it, and rounds it up to its clock divided by a whole number. It needs "xml". 0 leaves the sensor as
            it is set.

    Raises:
        ValueError: An option is out of range or unknown.
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
        output_hz: int = 0,
    ) -> None:
        self._has_inquiry = inquiry(calibration) is not None
        self._output_hz = checked_output_hz(output_hz, calibration)
        self._read = netft_calibration.read_tcp if calibration == "tcp" else netft_calibration.read_xml
        self.decoder = Decoder(counts_per_force, counts_per_torque, force_unit, torque_unit, internal_hz)
        self.health = self.decoder.health
        self.identity = ""
        command = rdt.START_BUFFERED if buffered else rdt.START
        self._startup = StartupSequence([Step("start", rdt.encode_request(command), "none")])
        self._answer: bytes | None = None  # the part received so far; None if no answer is awaited
        self._trouble = ""
        self._trouble_due_ns = 0
        if self._has_inquiry:
            self.decoder.calibrate(None)

    @property
    def state(self) -> str:
        """State of the session, as a short text for people."""
        return self._trouble or self._startup.state

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link: wait for the calibration, or start the records."""
        if not self._has_inquiry:
            self._startup.start(now_ns)
            return self.on_time(now_ns)
        self.identity, self._answer = "", b""
        self.decoder.calibrate(None)
        self._set_trouble("waiting for calibration", now_ns)
        return b""

    def receive(self, data: bytes, now_ns: int) -> list[WrenchSample]:
        """Decode bytes received at ``now_ns``; return the readings they complete."""
        if self._answer is not None:
            self._handle_answer(self._answer + data, now_ns)
            return []
        samples = self.decoder.receive(data, now_ns)
        if samples:
            self._startup.reading_received(now_ns)
        return samples

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None while closed."""
        return self._trouble_due_ns if self._trouble else self._startup.due_ns

    def on_time(self, now_ns: int) -> bytes:
        """Return the request that is due at ``now_ns``; empty if none is."""
        if not self._trouble:
            if request := self._startup.on_time(now_ns):
                self.decoder.forget()
            return request
        if now_ns >= self._trouble_due_ns:
            self._set_trouble("no calibration" if self._answer is not None else self._trouble, now_ns)
        return b""

    def stop(self) -> bytes:
        """End; return the request that stops the records."""
        self._startup.stop()
        self._answer, self._trouble = None, ""
        return rdt.encode_request(rdt.STOP)

    def _handle_answer(self, answer: bytes, now_ns: int) -> None:
        calibration = self._read(answer)
        self._answer = answer if calibration is None else None
        if isinstance(calibration, str):
            self.health.bad += 1
            self.health.bad_bytes += len(answer)
            self._set_trouble(f"wrong calibration: {calibration}", now_ns)
        elif calibration is not None:
            self.decoder.calibrate(calibration, rate_fault(self._output_hz, calibration))
            self.identity = calibration.identity
            self._trouble = ""
            self._startup.start(now_ns)

    def _set_trouble(self, trouble: str, now_ns: int) -> None:
        self._trouble, self._trouble_due_ns = trouble, now_ns + RETRY_PAUSE_NS


def inquiry(calibration: str = "tcp", output_hz: int = 0, **_others: Any) -> Inquiry | None:
    """Return the inquiry to send over TCP before the link is up, for the options of `Session`; None for none.

    Raises:
        ValueError: The calibration is not "tcp", "xml" or "config".
    """
    if calibration not in _INQUIRIES:
        raise ValueError(f"calibration must be one of {', '.join(_INQUIRIES)}, got {calibration!r}")
    found = _INQUIRIES[calibration]
    return replace(found, change=partial(needed_change, output_hz)) if found is not None and output_hz else found
