"""OptoForce sensors as seen from their line: a six-axis DAQ on a serial port, and the Ethernet converter.

Not emulated: the tare of a DAQ, which the daemon never requests.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from slipd.devices.optoforce import UDP_PERIOD
from slipd.devices.optoforce import optoforce_frames as frames
from slipd.devices.optoforce.optoforce_frames import UDP_COUNTS_PER_N, UDP_COUNTS_PER_NM
from slipd.devices.shared import rdt_records as rdt
from slipd.tools.sim.emulated_netft import NetftSensor
from slipd.tools.sim.emulators import EmulatedWrench, WrenchStream, whole

COUNTS_PER_N, COUNTS_PER_NM = [80.0, 80.0, 20.0], [2500.0, 2500.0, 4000.0]
SERIAL = b"HEXEB123"
POWER_ON_HZ = 100.0

_UDP_COUNTS_PER_UNIT = np.repeat((UDP_COUNTS_PER_N, UDP_COUNTS_PER_NM), 3)


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


def parse_requests(received: bytes) -> tuple[list[frames.Configuration | None], bytes]:
    """Parse the bytes that a DAQ received.

    Returns:
        The requests in order, with None for a request of the serial number, and the bytes to keep for the next call.
    """
    requests: list[frames.Configuration | None] = []
    at = 0
    while at < len(received):
        rest = received[at:]
        if rest.startswith(frames.GET_SERIAL_NUMBER):
            requests.append(None)
            at += len(frames.GET_SERIAL_NUMBER)
        elif (
            rest.startswith(frames.CONFIGURE)
            and len(rest) >= _CONFIGURE_LENGTH
            and frames.sum_matches(rest[:_CONFIGURE_LENGTH])
        ):
            requests.append(frames.Configuration(rest[frames.HEADER], rest[frames.HEADER + 1]))
            at += _CONFIGURE_LENGTH
        elif len(rest) < _CONFIGURE_LENGTH:
            break
        else:
            at += 1
    return requests, received[at:]


class OptoforceDaq(EmulatedWrench):
    """The serial DAQ on its line; its caller passes the time. It sends from power-on, at 100 Hz until configured.

    Its counter counts milliseconds, as that of a HEX does.

    Args:
        seed: Seed of its noise.
        rate_hz: Readings per second that its session must request.
        counts_per_n: Counts per newton of its axes.
        counts_per_nm: Counts per newton metre of its axes.
    """

    def __init__(
        self,
        seed: int,
        rate_hz: float = 1000.0,
        counts_per_n: Sequence[float] = COUNTS_PER_N,
        counts_per_nm: Sequence[float] = COUNTS_PER_NM,
    ) -> None:
        stream = WrenchStream(seed, POWER_ON_HZ)
        super().__init__(stream, rate_hz, counts_per_n=counts_per_n, counts_per_nm=counts_per_nm)
        self.status = 0
        """Status word of the readings from now on."""
        self._stream.start(0)
        self._counts_per_unit = np.array([*counts_per_n, *counts_per_nm])
        self._counter = 0

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes from the host; return the answers."""
        requests, self._received = parse_requests(self._received + data)
        return [self._answer(request, t_ns) for request in requests]

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the frames due by then."""
        output: list[bytes] = []
        for _, values in self._stream.due(t_ns):
            output.append(encode_reading(whole(values * self._counts_per_unit, 16), self._counter, self.status))
            self._counter += round(1000.0 / self._stream.rate_hz)
        return output

    def _answer(self, request: frames.Configuration | None, t_ns: int) -> bytes:
        if request is None:
            return frames.encode_frame(frames.SERIAL_NUMBER, SERIAL)
        if request.period_ms:
            self._stream.start(t_ns, 1000.0 / request.period_ms)
        else:
            self._stream.stop()
        return frames.encode_frame(frames.ACK, b"\0")


class OptoforceConverter(NetftSensor):
    """The Ethernet converter, a Net F/T with other counts. It sends on command, at 100 Hz until another rate is set.

    Args:
        seed: Seed of its noise.
        rate_hz: Records per second that its session must request.
    """

    def __init__(self, seed: int, rate_hz: float = 1000.0) -> None:
        super().__init__(seed, rate_hz, internal_hz=1000.0)
        self.options = {"wiring": "udp"}
        self._stream.rate_hz = POWER_ON_HZ
        self._counts_per_unit = _UDP_COUNTS_PER_UNIT

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle a datagram; the only answers are records."""
        command, value = rdt.parse_request(data) or (None, 0)
        if command == UDP_PERIOD and value:
            self._stream.rate_hz = 1000.0 / value
        return super().receive(data, t_ns)


def make(
    seed: int,
    wiring: str = "serial",
    counts_per_n: Sequence[float] = COUNTS_PER_N,
    counts_per_nm: Sequence[float] = COUNTS_PER_NM,
) -> OptoforceDaq | OptoforceConverter:
    """Return the emulator of the serial DAQ with these scales, or with ``udp`` of the Ethernet converter."""
    return OptoforceConverter(seed) if wiring == "udp" else OptoforceDaq(seed, 1000.0, counts_per_n, counts_per_nm)
