"""OptoForce sensors seen from their line: a six-axis DAQ on a serial port, and the Ethernet converter.

Left out: what a DAQ does about a tare, which the daemon never asks for.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from slipd.devices.optoforce import optoforce_frames as frames
from slipd.devices.optoforce.optoforce_decoder import UDP_COUNTS_PER_N, UDP_COUNTS_PER_NM
from slipd.devices.optoforce.optoforce_session import UDP_PERIOD
from slipd.devices.shared import rdt_records as rdt
from slipd.samples import Array
from slipd.sim.wrench_stream import WrenchStream, whole

COUNTS_PER_N, COUNTS_PER_NM = [80.0, 80.0, 20.0], [2500.0, 2500.0, 4000.0]
SERIAL = b"HEXEB123"
POWER_ON_HZ = 100.0

_UDP_COUNTS_PER_UNIT = np.repeat((UDP_COUNTS_PER_N, UDP_COUNTS_PER_NM), 3)
_MS = 1_000_000


class OptoforceDaq:
    """The serial DAQ's end of its line; time is told to it. It sends from power on, at 100 Hz until configured.

    Args:
        seed: Of its noise.
        rate_hz: Readings a second that its session is to ask for.
    """

    def __init__(self, seed: int, rate_hz: float = 1000.0) -> None:
        self.options: dict[str, Any] = {"counts_per_n": COUNTS_PER_N, "counts_per_nm": COUNTS_PER_NM}
        self.rate_hz = rate_hz
        self.status = 0
        """The status word of the readings from now on."""
        self._stream = WrenchStream(seed, POWER_ON_HZ)
        self._stream.start(0)
        self._counts_per_unit = np.array(COUNTS_PER_N + COUNTS_PER_NM)
        self._heard = b""
        self._counter = 0

    def opened(self, t_ns: int) -> None:
        """Forget the bytes of whoever had the line before."""
        self._heard = b""

    def feel(self, force_n: Array, torque_nm: Array) -> None:
        """Take what acts on the sensor from now on, in its own frame, N and N·m."""
        self._stream.feel(force_n, torque_nm)

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Take what the host wrote; return the answers."""
        asked, self._heard = frames.parse_requests(self._heard + data)
        return [self._answer(request, t_ns) for request in asked]

    def advance(self, t_ns: int) -> list[bytes]:
        """Go on to ``t_ns`` and return the frames due by then."""
        said: list[bytes] = []
        for _, values in self._stream.due(t_ns):
            said.append(frames.encode_reading(whole(values * self._counts_per_unit, 16), self._counter, self.status))
            self._counter += 1
        return said

    def _answer(self, request: frames.Configuration | None, t_ns: int) -> bytes:
        if request is None:
            return frames.encode_frame(frames.SERIAL_NUMBER, SERIAL)
        if request.period_ms:
            self._stream.start(t_ns, 1000.0 / request.period_ms)
        else:
            self._stream.stop()
        return frames.encode_frame(frames.ACK, b"\0")


class OptoforceConverter:
    """The Ethernet converter's end; time is told to it. It sends when told to, at 100 Hz until told another rate.

    Args:
        seed: Of its noise.
        rate_hz: Records a second that its session is to ask for.
    """

    def __init__(self, seed: int, rate_hz: float = 1000.0) -> None:
        self.options: dict[str, Any] = {"wiring": "udp"}
        self.rate_hz = rate_hz
        self.status = 0
        """The status word of the records from now on."""
        self._stream = WrenchStream(seed, POWER_ON_HZ)
        self._sequence = 0

    def opened(self, t_ns: int) -> None:
        """Take note of nothing: a network device does not see who listens."""

    def feel(self, force_n: Array, torque_nm: Array) -> None:
        """Take what acts on the sensor from now on, in its own frame, N and N·m."""
        self._stream.feel(force_n, torque_nm)

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Take a datagram; nothing is answered but by records."""
        command, value = rdt.parse_request(data) or (None, 0)
        if command == UDP_PERIOD and value:
            self._stream.rate_hz = 1000.0 / value
        elif command == rdt.START:
            self._sequence = 0
            self._stream.start(t_ns)
        elif command == rdt.STOP:
            self._stream.stop()
        return []

    def advance(self, t_ns: int) -> list[bytes]:
        """Go on to ``t_ns`` and return the records due by then."""
        said: list[bytes] = []
        for taken_ns, values in self._stream.due(t_ns):
            self._sequence += 1
            counts = whole(values * _UDP_COUNTS_PER_UNIT, 32)
            said.append(rdt.encode_record(counts, self._sequence, taken_ns // _MS, self.status))
        return said


def make(seed: int, wiring: str = "serial") -> OptoforceDaq | OptoforceConverter:
    """Return the emulator of the serial DAQ, or with ``udp`` of the Ethernet converter, with its noise seeded."""
    return OptoforceConverter(seed) if wiring == "udp" else OptoforceDaq(seed)
