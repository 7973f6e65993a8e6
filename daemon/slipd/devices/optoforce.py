"""OptoForce and OnRobot HEX and OMD force(/torque) sensors: on the serial line, or behind their Ethernet converter.

A serial DAQ sends frames of one sensor with three axes, of one with six, or of four with three; the converter sends RDT
records over UDP. Source: OptoForce General DAQ and Ethernet converter manuals.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from slipd.devices import Device, rdt
from slipd.devices import optoforce_frames as frames
from slipd.devices.conversation import Conversation, Step, TalkingSession
from slipd.devices.framing import Frames
from slipd.devices.health import DecoderHealth
from slipd.devices.numbering import Numbering
from slipd.samples import WrenchSample

CHANNELS = 4
FILTERS_HZ = (0.0, 500.0, 150.0, 50.0, 15.0, 5.0, 1.5)
"""Cut-off of each filter code; code 0 is no filter."""
SERIAL_PERIODS_MS = (1, 3, 10, 33, 100)
"""The rates that the serial DAQ documents, 1000 to 10 Hz."""
LONGEST_UDP_PERIOD_MS = 255

UDP_COUNTS_PER_N, UDP_COUNTS_PER_NM = 10_000.0, 100_000.0
UDP_FILTER, UDP_PERIOD = 0x0081, 0x0082

_CONFIGURATION, _SERIAL_NUMBER = "configuration", "serial number"
_WIRINGS = ("serial", "udp")
_HEAD = struct.Struct(">HH")  # counter, status; counts
_COUNTS_AT = frames.HEADER + _HEAD.size
_ONE_COUNTS, _SIX_COUNTS = struct.Struct(">3h"), struct.Struct(">6h")
_RAILS = frozenset((-(1 << 15), (1 << 15) - 1))
_COUNTER_SPAN = 1 << 16
_UDP_TICK_NS = 1_000_000
_UDP_RESERVED = 0xFFFF_0000

_OVERLOAD = 0x03F0
_SENSOR_ERRORS = {1: ("not_detected", "invalid"), 2: ("sensor_failure", "invalid"), 4: ("temperature",)}
_DAQ_ERRORS = {1: ("daq_error", "invalid"), 2: ("daq_communication", "invalid")}


class Decoder:
    """Makes wrench samples of the frames or records; ``torque_nm`` is None where the sensor has three axes.

    On the serial line the counts of a sensor mean what its sensitivity report says; until told, one count is one
    newton, or newton metre. The converter sends N and N·m. Its records carry the converter's millisecond counter as
    ``device_time_ns``; serial frames have no time.

    Status names: "overload" (on any axis: the manuals disagree which bit is which; or a count at the end of its
    range), "invalid" with "not_detected", "sensor_failure", "sensor_error", "daq_error" or "daq_communication",
    "temperature"; "sensor_<n>" and "several_sensors" say whose error it is, "unknown" is a reserved bit.

    Args:
        wiring: "serial", or "udp" for the Ethernet converter.
        counts_per_n: Counts per newton of each axis, x y z; serial only. A negative one turns the axis.
        counts_per_nm: Counts per newton metre of each axis, of a six-axis sensor; serial only.
        channel: Which sensor of a four-channel DAQ is handed on, 0 to 3; other DAQs have but one.
        counted: The serial frames' counter rises by one a frame, and shows losses.

    Raises:
        ValueError: An option is out of range or not known.
    """

    def __init__(
        self,
        wiring: str = "serial",
        counts_per_n: Sequence[float] = (1.0, 1.0, 1.0),
        counts_per_nm: Sequence[float] = (1.0, 1.0, 1.0),
        channel: int = 0,
        counted: bool = True,
    ) -> None:
        if wiring not in _WIRINGS:
            raise ValueError(f"wiring {wiring!r} is not known: {' or '.join(_WIRINGS)} is")
        if channel not in range(CHANNELS):
            raise ValueError(f"channel {channel} is not there: 0 to {CHANNELS - 1} are")
        for name, scales in (("counts_per_n", counts_per_n), ("counts_per_nm", counts_per_nm)):
            if len(scales) != 3 or not all(math.isfinite(scale) and scale for scale in scales):
                raise ValueError(f"{name} is {list(scales)}: three numbers, none of them zero, are needed")
        self.health = DecoderHealth()
        self.replies: list[tuple[bytes, bytes]] = []
        """What the last bytes answered to a session: header and body of each frame."""
        self._counts_per_unit = np.array([*counts_per_n, *counts_per_nm], dtype=np.float64)
        self._channel_at = _COUNTS_AT + channel * _ONE_COUNTS.size
        self._numbering = Numbering(_COUNTER_SPAN, self.health, in_order=True) if counted else None
        self._frames = Frames(frames.SYNC, frames.measure, frames.TYPICAL_LENGTH, self.health)
        self._records = rdt.Records(self.health, _UDP_RESERVED)
        self._read = self._read_records if wiring == "udp" else self._read_frames

    def forget(self) -> None:
        """Drop a begun frame and what was expected to follow: the line was closed."""
        self._records.forget()
        self._frames.forget()
        if self._numbering:
            self._numbering.forget()

    def receive(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        """Take bytes received at ``t_ns`` and return the readings they complete, in the sensor's frame."""
        samples = self._read(data, t_ns)
        self.health.good += len(samples)
        return samples

    def _read_records(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        heads, counts = self._records.receive(data)
        forces, torques = (counts[:, :3] / UDP_COUNTS_PER_N).tolist(), (counts[:, 3:] / UDP_COUNTS_PER_NM).tolist()
        return [
            WrenchSample(t_ns, ticks * _UDP_TICK_NS, force, torque, _words(status))
            for (ticks, status), force, torque in zip(heads, forces, torques, strict=True)
        ]

    def _read_frames(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        buffer, found = self._frames.receive(data)
        samples: list[WrenchSample] = []
        self.replies = []
        for at, _ in found:
            header = buffer[at : at + frames.HEADER]
            if header in (frames.ACK, frames.SERIAL_NUMBER):
                self.replies.append((header, buffer[at + frames.HEADER : at + frames.HEADER + header[3]]))
                continue
            counter, status = _HEAD.unpack_from(buffer, at + frames.HEADER)
            if self._numbering and not self._numbering.take(counter):
                continue
            if header == frames.ONE_6_AXIS:
                counts = _SIX_COUNTS.unpack_from(buffer, at + _COUNTS_AT)
            else:
                counts_at = self._channel_at if header == frames.FOUR_3_AXIS else _COUNTS_AT
                counts = _ONE_COUNTS.unpack_from(buffer, at + counts_at)
            if not _RAILS.isdisjoint(counts):
                status |= rdt.AT_RAIL
            values = (np.array(counts) / self._counts_per_unit[: len(counts)]).tolist()
            torque = values[3:] if len(values) > 3 else None
            samples.append(WrenchSample(t_ns, None, values[:3], torque, _words(status)))
        return samples


@lru_cache(maxsize=64)  # a condition lasts many readings, and few are there at a time
def _words(status: int) -> tuple[str, ...]:
    words: list[str] = []
    if status & (_OVERLOAD | rdt.AT_RAIL):
        words.append("overload")
    if sensor_error := status >> 10 & 7:
        words += _SENSOR_ERRORS.get(sensor_error, ("sensor_error", "invalid"))
    if daq_error := status >> 13 & 7:
        words += _DAQ_ERRORS.get(daq_error, ("daq_error", "invalid"))
    if number := status & 7:
        words.append(f"sensor_{number}")
    if status & 8:
        words.append("several_sensors")
    if status & _UDP_RESERVED:
        words.append("unknown")
    return tuple(dict.fromkeys(words))


class Session(TalkingSession[WrenchSample]):
    """Sets rate and filter, starts the readings, and does so again whenever they fall silent; it never tares.

    `state` is "closed", "waiting", "configuring", "running", or names what is in the way, such as "no answer to
    configuration". `identity` is the serial number of a serial DAQ; the converter tells none.

    Args:
        wiring: As of `Decoder`.
        period_ms: Time from one reading to the next: 1, 3, 10, 33 or 100 on a serial line, 1 to 255 over UDP.
        filter_hz: Cut-off of the sensor's filter: 500, 150, 50, 15, 5, 1.5, or 0 for none.
        reading: The other options of `Decoder`.

    Raises:
        ValueError: An option is out of range or not known.
    """

    decoder: Decoder

    def __init__(self, wiring: str = "serial", period_ms: int = 1, filter_hz: float = 150.0, **reading: Any) -> None:
        decoder = Decoder(wiring, **reading)
        periods_ms = SERIAL_PERIODS_MS if wiring == "serial" else range(1, LONGEST_UDP_PERIOD_MS + 1)
        if period_ms not in periods_ms:
            raise ValueError(f"period_ms {period_ms} is not known: 1, 3, 10, 33, 100 are, and 1 to 255 over UDP")
        if filter_hz not in FILTERS_HZ:
            raise ValueError(f"filter_hz {filter_hz} is not known: {', '.join(f'{hz:g}' for hz in FILTERS_HZ)} are")
        filter_code = FILTERS_HZ.index(filter_hz)
        if wiring == "serial":
            steps = _serial_steps(period_ms, filter_code)
            stop = frames.encode_configuration(frames.Configuration(0, filter_code))
        else:
            steps = _udp_steps(period_ms, filter_code)
            stop = rdt.encode_request(rdt.STOP)
        super().__init__(decoder, Conversation(steps), stop)

    def _hear(self, now_ns: int) -> None:
        for header, body in self.decoder.replies:
            if (header, self._talk.asked) == (frames.ACK, _CONFIGURATION):
                self._talk.answered(now_ns, f"refused {_CONFIGURATION}: code {body[0]}" if body[0] else "")
            elif (header, self._talk.asked) == (frames.SERIAL_NUMBER, _SERIAL_NUMBER):
                self.identity = _identity(body)
                self._talk.answered(now_ns)


def _serial_steps(period_ms: int, filter_code: int) -> list[Step]:
    configuration = frames.encode_configuration(frames.Configuration(period_ms, filter_code))
    return [
        Step(_CONFIGURATION, configuration),
        Step(_SERIAL_NUMBER, frames.ASK_SERIAL_NUMBER, "optional"),
    ]


def _udp_steps(period_ms: int, filter_code: int) -> list[Step]:
    return [
        Step("rate", rdt.encode_request(UDP_PERIOD, period_ms), "none"),
        Step("filter", rdt.encode_request(UDP_FILTER, filter_code), "none"),
        Step("start", rdt.encode_request(rdt.START), "none"),
    ]


def _identity(body: bytes) -> str:
    serial = body.decode("latin-1").strip(" \0")
    return f"S/N {serial}" if serial.isascii() and serial.isprintable() and serial else ""


DEVICE = Device(
    "optoforce",
    "wrench",
    ("serial", "udp"),
    Decoder,
    Session,
    rates_hz=(1000.0 / LONGEST_UDP_PERIOD_MS, 1000.0),
    baud=1_000_000,
    wired=True,
    frame="an OptoForce frame",
)
