"""Force/torque sensors that send RDT records over UDP, and the serial sibling of one of them.

An ATI Ethernet Axia with its calibration over TCP and HTTP; the Ethernet converter of OptoForce, and its six-axis DAQ
on a serial port. Not emulated: what the web pages and the console of an Axia can change, but for the output rate, and
the tare of a DAQ, which the daemon never requests.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from slipd.devices.netft import netft_calibration
from slipd.devices.netft.netft_calibration import rounded_hz
from slipd.devices.optoforce import UDP_PERIOD
from slipd.devices.optoforce import optoforce_frames as frames
from slipd.devices.optoforce.optoforce_frames import UDP_COUNTS_PER_N, UDP_COUNTS_PER_NM
from slipd.devices.shared import rdt_records as rdt
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.frame_scanner import NO_FRAME, FrameScanner
from slipd.tools.sim.emulators import EmulatedWrench, WrenchStream, whole

INTERNAL_HZ = 7000
COUNTS_PER_N, COUNTS_PER_NM = 100_000, 2_000_000
CALIBRATION: dict[str, Any] = {
    "counts_per_force": COUNTS_PER_N,
    "counts_per_torque": COUNTS_PER_NM,
    "force_unit": "N",
    "torque_unit": "N-m",
}
"""What the sensor itself sends."""
SERIAL = "FT27462"

_CHANGE = re.compile(rb"GET /comm\.cgi\?comrdtrate=(\d{1,5}) HTTP/1\.[01]\r\n")
_CHANGED = b"HTTP/1.0 200 OK\r\nContent-Type: text/html\r\n\r\n<html></html>"


def encode_tcp(counts_per_force: int, counts_per_torque: int, force_code: int = 2, torque_code: int = 3) -> bytes:
    """Return the answer to READCALINFO; the default unit codes are those of N and N·m."""
    return netft_calibration.TCP_REPLY.pack(
        netft_calibration.TCP_HEADER, force_code, torque_code, counts_per_force, counts_per_torque
    )


def encode_xml(tags: Mapping[str, str | int]) -> bytes:
    """Return the HTTP answer that contains the page with the given tags."""
    page = "".join(f"<{name}>{value}</{name}>\n" for name, value in tags.items())
    head = "HTTP/1.0 200 OK\r\nContent-Type: text/xml\r\n\r\n"
    return f'{head}<?xml version="1.0"?><netft>\n{page}</netft>\n'.encode()


def parse_request(datagram: bytes) -> tuple[int, int] | None:
    """Return command and data of a request; None if the datagram is not a request."""
    if len(datagram) != rdt.REQUEST.size:
        return None
    header, command, data = rdt.REQUEST.unpack(datagram)
    return (command, data) if header == rdt.REQUEST_HEADER else None


def encode_record(counts: Sequence[int], sequence: int, ft_sequence: int, status: int = 0) -> bytes:
    """Return one record of 36 bytes as a sensor sends it.

    Args:
        counts: Force x y z, torque x y z; each within an int32.
        sequence: Number of the record since the start, from 1; sent modulo 2^32.
        ft_sequence: The sensor's own sample counter, its clock; sent modulo 2^32.
        status: The 32 status bits.
    """
    return rdt.RECORD.pack(sequence % rdt.SPAN, ft_sequence % rdt.SPAN, status, *counts)


class NetftSensor(EmulatedWrench):
    """An Ethernet Axia.

    Args:
        seed: Seed of its noise.
        rate_hz: Records per second.
        block: Records per datagram when they are buffered.
        internal_hz: Rate of its sample counter; 0: that of an Axia.
        calibration: Where its session learns what a count is worth; with ``config`` it is as the next options say.
        counts_per_force: Counts per unit of force.
        counts_per_torque: Counts per unit of torque.
        force_unit: Unit of force.
        torque_unit: Unit of torque.

    Attributes:
        status: Status word of the records from now on.
    """

    def __init__(
        self,
        seed: int,
        rate_hz: float = 4000.0,
        block: int = 10,
        internal_hz: float = 0.0,
        calibration: str = "tcp",
        counts_per_force: float = COUNTS_PER_N,
        counts_per_torque: float = COUNTS_PER_NM,
        force_unit: str = "N",
        torque_unit: str = "N-m",
    ) -> None:
        given: dict[str, Any] = {
            "counts_per_force": counts_per_force,
            "counts_per_torque": counts_per_torque,
            "force_unit": force_unit,
            "torque_unit": torque_unit,
        }
        super().__init__(WrenchStream(seed, rate_hz), rate_hz, **(given if calibration == "config" else CALIBRATION))
        self.status = 0
        value = netft_calibration.from_counts(**self.options)
        self._counts_per_unit = np.repeat((1.0 / value.force_n, 1.0 / value.torque_nm), 3)
        self._internal_hz = internal_hz or INTERNAL_HZ
        self._left = 0  # records to send; 0: no limit
        self._block, self._per_datagram = block, 1
        self._sequence = 0
        self._waiting: list[bytes] = []

    def inquire(self, request: bytes) -> bytes:
        """Return the answer to an inquiry over TCP or HTTP, and set the output rate; empty for anything else."""
        if request == netft_calibration.TCP_INQUIRY.request:
            return encode_tcp(COUNTS_PER_N, COUNTS_PER_NM)
        if request == netft_calibration.XML_INQUIRY.request:
            page: dict[str, str | int] = {"cfgcalsn": SERIAL, "runrate": INTERNAL_HZ, "scfgfu": "N", "scfgtu": "Nm"}
            page |= {"comrdtrate": round(self.rate_hz)}
            return encode_xml(page | {"cfgcpf": COUNTS_PER_N, "cfgcpt": COUNTS_PER_NM})
        if (change := _CHANGE.match(request)) and 1 <= int(change[1]) <= INTERNAL_HZ:
            self.rate_hz = self._stream.rate_hz = rounded_hz(int(change[1]), INTERNAL_HZ)
            return _CHANGED
        return b""

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle a datagram; the only answers are records."""
        command, count = parse_request(data) or (None, 0)
        if command in (rdt.START, rdt.START_BUFFERED):
            self._per_datagram = self._block if command == rdt.START_BUFFERED else 1
            self._sequence, self._waiting, self._left = 0, [], count
            self._stream.start(t_ns)
        elif command == rdt.STOP:
            self._stream.stop()
        return []

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the datagrams complete by then."""
        output: list[bytes] = []
        for taken_ns in self._stream.times(t_ns):
            self._waiting.append(self._frame(taken_ns))
            is_last = self._sequence == self._left
            if len(self._waiting) == self._per_datagram or is_last:
                output.append(b"".join(self._waiting))
                self._waiting = []
            if is_last:
                self._stream.stop()
        return output

    def _frame(self, taken_ns: int) -> bytes:
        self._sequence += 1
        counts = whole(self._stream.reading() * self._counts_per_unit, 32)
        ticks = int(taken_ns * self._internal_hz // 1_000_000_000)
        return encode_record(counts, self._sequence, ticks, self.status)


POWER_ON_HZ = 100.0
"""Rate of the OptoForce sensors until their session requests another."""

_UDP_COUNTS_PER_UNIT = np.repeat((UDP_COUNTS_PER_N, UDP_COUNTS_PER_NM), 3)


class OptoforceConverter(NetftSensor):
    """The Ethernet converter, a Net F/T with other counts. It sends on command, at 100 Hz until another rate is set.

    Args:
        seed: Seed of its noise.
    """

    def __init__(self, seed: int) -> None:
        super().__init__(seed, rate_hz=1000.0, internal_hz=1000.0)
        self.options = {"wiring": "udp"}
        self._stream.rate_hz = POWER_ON_HZ
        self._counts_per_unit = _UDP_COUNTS_PER_UNIT

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle a datagram; the only answers are records."""
        command, value = parse_request(data) or (None, 0)
        if command == UDP_PERIOD and value:
            self._stream.rate_hz = 1000.0 / value
        return super().receive(data, t_ns)


DAQ_COUNTS_PER_N, DAQ_COUNTS_PER_NM = [80.0, 80.0, 20.0], [2500.0, 2500.0, 4000.0]
DAQ_SERIAL = b"HEXEB123"

_READING_HEADERS = {3: frames.ONE_3_AXIS, 6: frames.ONE_6_AXIS, 12: frames.FOUR_3_AXIS}
_CONFIGURE_LENGTH = 9
_COUNTER_SPAN = 1 << 16


def encode_reading(counts: Sequence[int], counter: int, status: int = 0) -> bytes:
    """Return a reading as a DAQ sends it.

    Args:
        counts: Three, six, or twelve for four sensors; each within an int16.
        counter: Sequence number of the frame; sent modulo 2^16.
        status: The 16 status bits.
    """
    body = struct.pack(f">HH{len(counts)}h", counter % _COUNTER_SPAN, status, *counts)
    return frames.encode_frame(_READING_HEADERS[len(counts)], body)


def _measure(buffer: bytes, at: int) -> int:
    """Return the length of the request to a DAQ at ``at``, 0 if it may be incomplete, else `NO_FRAME`."""
    if buffer.startswith(frames.GET_SERIAL_NUMBER, at):
        return len(frames.GET_SERIAL_NUMBER)
    frame = buffer[at : at + _CONFIGURE_LENGTH]
    if len(frame) < _CONFIGURE_LENGTH:
        return 0
    return _CONFIGURE_LENGTH if frame.startswith(frames.CONFIGURE) and frames.sum_matches(frame) else NO_FRAME


class OptoforceDaq(EmulatedWrench):
    """The serial DAQ. It sends from power-on, at 100 Hz until configured. Its counter counts milliseconds, like a HEX.

    Args:
        seed: Seed of its noise.
        counts_per_n: Counts per newton of its axes.
        counts_per_nm: Counts per newton metre of its axes.

    Attributes:
        status: Status word of the readings from now on.
    """

    def __init__(self, seed: int, counts_per_n: Sequence[float], counts_per_nm: Sequence[float]) -> None:
        stream = WrenchStream(seed, POWER_ON_HZ)
        super().__init__(stream, 1000.0, counts_per_n=counts_per_n, counts_per_nm=counts_per_nm)
        self._requests = FrameScanner(b"", _measure, _CONFIGURE_LENGTH, DecoderHealth())
        self.status = 0
        self._stream.start(0)
        self._counts_per_unit = np.array([*counts_per_n, *counts_per_nm])
        self._counter = 0

    def _frame(self, taken_ns: int) -> bytes:
        frame = encode_reading(whole(self._stream.reading() * self._counts_per_unit, 16), self._counter, self.status)
        self._counter += round(1000.0 / self._stream.rate_hz)
        return frame

    def _obey(self, buffer: bytes, at: int, t_ns: int) -> list[bytes]:
        if buffer.startswith(frames.GET_SERIAL_NUMBER, at):
            return [frames.encode_frame(frames.SERIAL_NUMBER, DAQ_SERIAL)]
        period_ms = buffer[at + frames.HEADER]
        if period_ms:
            self._stream.start(t_ns, 1000.0 / period_ms)
        else:
            self._stream.stop()
        return [frames.encode_frame(frames.ACK, b"\0")]


def make_optoforce(
    seed: int,
    wiring: str = "serial",
    counts_per_n: Sequence[float] = DAQ_COUNTS_PER_N,
    counts_per_nm: Sequence[float] = DAQ_COUNTS_PER_NM,
) -> OptoforceDaq | OptoforceConverter:
    """Return the emulator of the serial DAQ with these scales, or with ``udp`` of the Ethernet converter."""
    return OptoforceConverter(seed) if wiring == "udp" else OptoforceDaq(seed, counts_per_n, counts_per_nm)
