"""An ATI Ethernet Axia as seen from its network: RDT records over UDP, and its calibration over TCP and HTTP.

Not emulated: what its web pages and console can change, but for the output rate.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from slipd.devices.netft import netft_calibration
from slipd.devices.netft.netft_calibration import rounded_hz
from slipd.devices.shared import rdt_records as rdt
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


class NetftSensor(EmulatedWrench):
    """The sensor; its caller passes the time.

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
        """Status word of the records from now on."""
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
        command, count = rdt.parse_request(data) or (None, 0)
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
        for taken_ns, values in self._stream.due(t_ns):
            self._sequence += 1
            counts = whole(values * self._counts_per_unit, 32)
            ticks = int(taken_ns * self._internal_hz // 1_000_000_000)
            self._waiting.append(rdt.encode_record(counts, self._sequence, ticks, self.status))
            is_last = self._sequence == self._left
            if len(self._waiting) == self._per_datagram or is_last:
                output.append(b"".join(self._waiting))
                self._waiting = []
            if is_last:
                self._stream.stop()
                break
        return output


make = NetftSensor
